// A PLY file that is written in pieces, in any order, by one process or several.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// The header of the file that write_mesh makes of a mesh with so many vertices and triangles. The other two
/// have a line for each property of the vertices and the faces.
std::string ply_header(std::uint64_t vertices, std::uint64_t triangles, const std::string& of_vertices = "",
                       const std::string& of_faces = "");

/// Vertices and triangles of a PLY file, put where they belong: with all of them there it has the bytes of
/// write_mesh. All failures are IoErrors.
class PlyPieces {
 public:
    /// Into a file that appears when the caller commits it; it has to live as long.
    PlyPieces(AtomicFile& file, std::uint64_t vertices, std::uint64_t triangles);
    /// Into a file that several processes on one file system write, all of them open at a time; what they put
    /// must not overlap. `make`: the file is made; else it has to be there.
    PlyPieces(const std::filesystem::path& path, bool make, std::uint64_t vertices, std::uint64_t triangles);
    ~PlyPieces();
    PlyPieces(const PlyPieces&) = delete;
    PlyPieces& operator=(const PlyPieces&) = delete;

    /// For one of those who write.
    void put_header();
    void put_points(std::uint64_t first, const Vec3f* points, std::uint64_t count);
    void put_triangles(std::uint64_t first, const Triangle* triangles, std::uint64_t count);
    /// Of a file with several writers: everything that was put has reached the disk once it returns. Call it
    /// last.
    void close();

 private:
    void write_at(std::uint64_t at, const void* data, std::size_t bytes);
    [[noreturn]] void fail(const char* doing) const;

    AtomicFile* file_ = nullptr;
    std::filesystem::path path_;
    std::string header_;
    std::uint64_t first_triangle_at_;
    int fd_ = -1;
};

}  // namespace vdbgeo
