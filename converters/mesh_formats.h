// What the mesh formats share inside mesh_file.cpp and mesh_*.cpp.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "converters/mapped_file.h"
#include "converters/mesh_file.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo::mesh_formats {

/// Whether the bytes begin as this format's files do.
bool is_ply(std::string_view bytes);
bool is_off(std::string_view bytes);
bool is_glb(std::string_view bytes);
bool is_vtk_xml(std::string_view bytes);
bool is_vtk_legacy(std::string_view bytes);
/// Whether the size is the one that the count at byte 80 asks for.
bool is_binary_stl(std::string_view bytes);

TriMesh read_ply(const MappedFile& file, const Progress& progress);
TriMesh read_obj(const MappedFile& file, const Progress& progress);
TriMesh read_off(const MappedFile& file, const Progress& progress);
TriMesh read_stl(const MappedFile& file, const Progress& progress);
TriMesh read_glb(const MappedFile& file, const Progress& progress);
TriMesh read_vtk_xml(const MappedFile& file, const Progress& progress);
TriMesh read_vtk_legacy(const MappedFile& file, const Progress& progress);

/// A file to be written: where, and how messages call it.
struct Output {
    AtomicFile& file;
    const std::string& name;
    const MeshWriteOptions& options;
    const Progress& progress;
};

void write_ply(const TriMesh& mesh, const Output& out);
void write_obj(const TriMesh& mesh, const Output& out);
void write_off(const TriMesh& mesh, const Output& out);
void write_stl(const TriMesh& mesh, const Output& out);
void write_glb(const TriMesh& mesh, const Output& out);
void write_vtp(const TriMesh& mesh, const Output& out);
void write_vtu(const TriMesh& mesh, const Output& out);

/// STL counts facets in 32 bits: InvalidInput for more.
void check_stl_facets(std::uint64_t facets, const std::string& name);

/// Loops report this often.
constexpr std::size_t report_every = 1 << 16;

using Buffer = fmt::memory_buffer;

constexpr bool host_is_big_endian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;

/// The value at `from`, which need not be aligned, with its bytes reversed where `swap`.
template <class T>
T load(const char* from, bool swap) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, from, sizeof(T));
    if (swap) std::reverse(bytes, bytes + sizeof(T));
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
}

/// Appends the value, little-endian.
template <class T>
void put(Buffer& buffer, T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    if (host_is_big_endian) std::reverse(bytes, bytes + sizeof(T));
    buffer.append(bytes, bytes + sizeof(T));
}

/// Appends "x y z" with the digits asked for.
void put_point(Buffer& buffer, const Vec3f& point, const MeshWriteOptions& options);

/// Appends " r g b", each 0…1 with all digits.
void put_color(Buffer& buffer, const float* color);

/// Cuts a polygon into triangles around its first corner.
inline void append_fan(const std::vector<VertexId>& polygon, Array<Triangle>& triangles) {
    for (std::size_t k = 2; k < polygon.size(); ++k)
        triangles.push_back({polygon[0], polygon[k - 1], polygon[k]});
}

/// Writes `count` elements: append(i, buffer) adds the bytes of element i. Blocks of elements are made in
/// parallel and written in order, so the bytes are the same for any number of threads.
template <class Append>
void write_elements(AtomicFile& file, std::size_t count, const Progress& progress, const Append& append) {
    constexpr std::size_t block = 1 << 13, blocks = 32;
    std::array<Buffer, blocks> buffers;
    for (std::size_t first = 0; first < count; first += block * blocks) {
        parallel_for(blocks, 1, [&](std::size_t b) {
            buffers[b].clear();
            const std::size_t begin = std::min(first + b * block, count),
                              end = std::min(begin + block, count);
            for (std::size_t i = begin; i < end; ++i) append(i, buffers[b]);
        });
        for (const Buffer& buffer : buffers) file.write(buffer.data(), buffer.size());
        progress.report(static_cast<double>(first) / static_cast<double>(count));
    }
}

}  // namespace vdbgeo::mesh_formats
