// A piece of a VTK file on its way to a mesh.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "converters/vtk_arrays.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::mesh_formats {

/// The arrays of a piece as they are declared: PolyData with sections Points, Polys and Strips, or an
/// unstructured grid with Points and Cells.
struct VtkPiece {
    std::map<std::string, std::uint64_t> counts;            // NumberOfPoints …
    std::map<std::string, std::vector<VtkArray>> sections;  // PointData, Points …

    std::uint64_t count(const char* name) const {
        const auto found = counts.find(name);
        return found == counts.end() ? 0 : found->second;
    }
    const VtkArray* find(const char* section, const char* array) const {
        const auto found = sections.find(section);
        if (found == sections.end()) return nullptr;
        for (const VtkArray& a : found->second)
            if (!array || a.name == array) return &a;
        return nullptr;
    }
};

/// Cell types of VTK that have a meaning here.
enum VtkCell {
    vertex = 1,
    poly_vertex,
    line,
    poly_line,
    triangle,
    triangle_strip,
    polygon,
    pixel,
    quad,
    tetra,
    quadratic_tetra = 24
};

/// Whether a cell is a piece of space: a tetrahedron, a hexahedron and the like.
bool is_solid(std::int64_t cell_type);
/// "a tetrahedron", or "of type 99".
std::string cell_name(std::int64_t cell_type);

/// Decodes the arrays of a piece. Throws InvalidInput "FILE: …".
class VtkPieceDecoder {
 public:
    VtkPieceDecoder(const VtkPiece& piece, const VtkEncoding& encoding, const std::string& file)
        : piece_(piece), encoding_(encoding), file_(file) {}

    std::uint64_t count(const char* name) const { return piece_.count(name); }
    /// How many points there are, at most as many as a mesh can have; sets their coordinates.
    std::uint64_t points(VtkValues& xyz) const;
    /// Calls cell(number, type, corners) for the cells of a section, all of one type or, without a type, each
    /// of its own. Corners name existing points.
    template <class Cell>
    void for_each_cell(const char* section, std::uint64_t count, std::optional<VtkCell> type,
                       const Cell& cell) const;
    /// The types of the cells of an unstructured grid.
    VtkValues types() const { return needed("Cells", "types", count("NumberOfCells")); }
    /// The arrays of a section as properties, but for those called as in `without`; `of`: the element of the
    /// file that each element of the mesh comes from, nullptr where they are the same.
    std::vector<MeshProperty> properties(const char* section, std::uint64_t tuples,
                                         const std::vector<std::uint64_t>* of,
                                         const std::set<std::string>& without = {}) const;
    /// The values of the array of this name, of one component, where there is one.
    std::optional<VtkValues> find(const char* section, const char* name, std::uint64_t tuples) const;

    [[noreturn]] void fail(const std::string& message) const;

 private:
    VtkValues needed(const char* section, const char* name, std::optional<std::uint64_t> expected) const;

    const VtkPiece& piece_;
    const VtkEncoding& encoding_;
    const std::string& file_;
};

/// The flat cells of a piece, cut into triangles. Throws InvalidInput "FILE: …".
TriMesh read_piece(const VtkPiece& piece, bool poly_data, const VtkEncoding& encoding,
                   const std::string& file, const Progress& progress);

template <class Cell>
void VtkPieceDecoder::for_each_cell(const char* section, std::uint64_t count, std::optional<VtkCell> type,
                                    const Cell& cell) const {
    if (count == 0) return;
    const std::uint64_t points = piece_.count("NumberOfPoints");
    const VtkValues ends = needed(section, "offsets", count), all = needed(section, "connectivity", {});
    std::optional<VtkValues> types;
    if (!type) types = needed(section, "types", count);
    std::vector<VertexId> corners;
    std::int64_t begin = 0;
    for (std::uint64_t c = 0; c < count; ++c) {
        const std::int64_t end = ends.integer(c);
        if (end < begin || static_cast<std::uint64_t>(end) > all.size())
            fail(fmt::format("{}: cell {} ends at corner {} of {}", section, c, end, all.size()));
        corners.clear();
        for (std::int64_t i = begin; i < end; ++i) {
            const std::int64_t v = all.integer(static_cast<std::uint64_t>(i));
            if (v < 0 || static_cast<std::uint64_t>(v) >= points)
                fail(fmt::format("{}: cell {} names point {} of {}", section, c, v, points));
            corners.push_back(static_cast<VertexId>(v));
        }
        cell(c, types ? types->integer(c) : std::int64_t(*type), corners);
        begin = end;
    }
}

}  // namespace vdbgeo::mesh_formats
