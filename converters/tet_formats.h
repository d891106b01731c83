// What the formats of tetrahedra share inside tet_file.cpp and tet_*.cpp.
#pragma once

#include <array>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "converters/mapped_file.h"
#include "converters/mesh_formats.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::tet_formats {

using mesh_formats::Buffer;
using mesh_formats::report_every;
using mesh_formats::write_elements;

/// What a file holds, before it is a mesh.
struct TetSoup {
    Array<Vec3d> points;
    Array<Tetrahedron> tets;
    Array<double> labels;         ///< of each tetrahedron, as the file has it; empty: none
    Array<std::uint8_t> middles;  ///< 1 for points within an edge of a quadratic tetrahedron; may be short
    std::uint64_t surfaces = 0;   ///< triangles and quadrilaterals that were passed over
    std::vector<MeshProperty> vertex_properties, tet_properties;

    void add_middle(std::uint64_t point) {
        if (middles.size() <= point) middles.resize(points.size(), 0);
        middles[point] = 1;
    }
};

/// Readers of the formats. What they hand back names existing points only, its numbers need not be finite.
TetSoup read_vtu(const std::filesystem::path& path, const Progress& progress);
TetSoup read_medit(const std::filesystem::path& path, const Progress& progress);
TetSoup read_gmsh(const std::filesystem::path& path, const Progress& progress);
TetSoup read_tetgen(const std::filesystem::path& path, const Progress& progress);

/// Whether a .vtu file has tetrahedra among its cells.
bool vtu_holds_tets(const std::filesystem::path& path);

/// The pairs of regions that faces lie between: sorted by the region behind, then by that before.
class FaceGroups {
 public:
    explicit FaceGroups(const TetMesh& mesh);
    std::size_t size() const { return pairs_.size(); }
    /// {inside, outside} of group g, counted from 0.
    const std::array<std::int32_t, 2>& regions(std::size_t g) const { return pairs_[g]; }
    std::size_t of(const std::array<std::int32_t, 2>& pair) const;
    /// "boundary_1" or "interface_1_2".
    std::string name(std::size_t g) const;

 private:
    std::vector<std::array<std::int32_t, 2>> pairs_;
};

/// What is to be written: a good mesh with its faces.
struct TetOutput {
    const TetMesh& mesh;
    const FaceGroups& groups;
    const std::filesystem::path& path;
    const Progress& progress;
};

void write_vtu(const TetOutput& out);
void write_medit(const TetOutput& out);
void write_gmsh(const TetOutput& out);
void write_tetgen(const TetOutput& out);

/// Appends a number as text: the shortest that reads back as the same one.
template <class T>
void put_text(Buffer& buffer, T value) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;
    buffer.append(text, end);
}

/// Appends numbers with blanks between and a line's end.
template <class First, class... More>
void put_line(Buffer& buffer, First first, More... more) {
    put_text(buffer, first);
    ((buffer.push_back(' '), put_text(buffer, more)), ...);
    buffer.push_back('\n');
}

}  // namespace vdbgeo::tet_formats
