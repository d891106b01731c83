#include "converters/vtk_piece.h"

#include <algorithm>
#include <utility>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

/// The flat cells of one piece on their way to a mesh.
class SurfaceReader {
 public:
    SurfaceReader(const VtkPieceDecoder& piece, const Progress& progress)
        : piece_(piece), progress_(progress) {}

    TriMesh read(bool poly_data) {
        take_points();
        if (poly_data) {
            const std::uint64_t before = piece_.count("NumberOfVerts") + piece_.count("NumberOfLines");
            const std::uint64_t polygons = piece_.count("NumberOfPolys"),
                                strips = piece_.count("NumberOfStrips");
            take_cells("Polys", polygons, before, polygon);
            take_cells("Strips", strips, before + polygons, triangle_strip);
            cells_ = before + polygons + strips;
        } else {
            cells_ = piece_.count("NumberOfCells");
            take_cells("Cells", cells_, 0, {});
        }
        mesh_.vertex_properties = piece_.properties("PointData", mesh_.points.size(), nullptr);
        progress_.report(0.7);
        mesh_.face_properties = piece_.properties("CellData", cells_, &cell_of_);
        return std::move(mesh_);
    }

 private:
    void take_points() {
        VtkValues xyz;
        mesh_.points.resize(piece_.points(xyz));
        for (std::uint64_t i = 0; i < mesh_.points.size(); ++i) {
            for (int a = 0; a < 3; ++a)
                mesh_.points[i][a] = xyz.number(3 * i + static_cast<std::uint64_t>(a));
            if (i % report_every == 0) progress_.report(0.2);
        }
    }

    /// `first`: the number of the section's first cell among all.
    void take_cells(const char* section, std::uint64_t count, std::uint64_t first,
                    std::optional<VtkCell> type) {
        piece_.for_each_cell(section, count, type, [&](std::uint64_t c, std::int64_t own, auto& corners) {
            add_cell(own, c, corners);
            cell_of_.resize(mesh_.triangles.size(), first + c);
            if (c % report_every == 0) progress_.report(0.5);
        });
    }

    void add_cell(std::int64_t type, std::uint64_t number, std::vector<VertexId>& corners) {
        const std::size_t n = corners.size();
        if (type >= vertex && type <= poly_line) return;
        if (type == tetra || type == quadratic_tetra)
            piece_.fail(fmt::format(
                "cell {} is a tetrahedron: only surfaces are read; vdbgeo convert makes one of the "
                "tetrahedra's boundary",
                number));
        if (type > quad || type < vertex)
            piece_.fail(fmt::format("cell {} is {}: only surfaces are read", number, cell_name(type)));
        if (n < 3 || (type == triangle && n != 3) || ((type == quad || type == pixel) && n != 4))
            piece_.fail(fmt::format("cell {} of type {} has {} corners", number, type, n));
        if (type == triangle_strip) {
            for (std::size_t k = 2; k < n; ++k) {
                const VertexId a = corners[k - 2], b = corners[k - 1], c = corners[k];
                mesh_.triangles.push_back(k % 2 == 0 ? Triangle{a, b, c} : Triangle{b, a, c});
            }
            return;
        }
        if (type == pixel) std::swap(corners[2], corners[3]);
        append_fan(corners, mesh_.triangles);
    }

    const VtkPieceDecoder& piece_;
    const Progress& progress_;
    TriMesh mesh_;
    std::uint64_t cells_ = 0;
    std::vector<std::uint64_t> cell_of_;  // of each triangle
};

}  // namespace

bool is_solid(std::int64_t type) {
    // what VTK has between 21 and 36, and from 68, of lines and faces
    constexpr std::int64_t flat[] = {21, 22, 23, 28, 30, 34, 35, 36, 68, 69, 70, 75, 76, 77};
    return type < 0 || (type > quad && std::find(std::begin(flat), std::end(flat), type) == std::end(flat));
}

std::string cell_name(std::int64_t type) {
    constexpr std::pair<int, const char*> names[] = {{tetra, "a tetrahedron"},
                                                     {11, "a voxel"},
                                                     {12, "a hexahedron"},
                                                     {13, "a wedge"},
                                                     {14, "a pyramid"},
                                                     {15, "a pentagonal prism"},
                                                     {16, "a hexagonal prism"},
                                                     {quadratic_tetra, "a quadratic tetrahedron"},
                                                     {25, "a quadratic hexahedron"},
                                                     {26, "a quadratic wedge"},
                                                     {27, "a quadratic pyramid"},
                                                     {42, "a polyhedron"},
                                                     {71, "a Lagrange tetrahedron"},
                                                     {72, "a Lagrange hexahedron"}};
    for (const auto& [known, name] : names)
        if (type == known) return name;
    return fmt::format("of type {}", type);
}

void VtkPieceDecoder::fail(const std::string& message) const {
    throw InvalidInput(fmt::format("{}: {}", file_, message));
}

VtkValues VtkPieceDecoder::needed(const char* section, const char* name,
                                  std::optional<std::uint64_t> expected) const {
    const VtkArray* const array = piece_.find(section, name);
    if (!array) fail(fmt::format("{}: no array {}", section, in_quotes(name)));
    return vtk_values(*array, encoding_, expected, file_);
}

std::uint64_t VtkPieceDecoder::points(VtkValues& xyz) const {
    const std::uint64_t count = piece_.count("NumberOfPoints");
    if (count > TriMesh::max_vertices) fail(fmt::format("{} points, more than 2^32-1", count));
    if (count == 0) return 0;
    const VtkArray* const array = piece_.find("Points", nullptr);
    if (!array) fail(fmt::format("{} points, and no array of them", count));
    if (array->components != 3) fail(fmt::format("points of {} components, expected 3", array->components));
    xyz = vtk_values(*array, encoding_, 3 * count, file_);
    return count;
}

std::optional<VtkValues> VtkPieceDecoder::find(const char* section, const char* name,
                                               std::uint64_t tuples) const {
    const VtkArray* const array = piece_.find(section, name);
    if (!array || array->components != 1) return {};
    return vtk_values(*array, encoding_, tuples, file_);
}

std::vector<MeshProperty> VtkPieceDecoder::properties(const char* section, std::uint64_t tuples,
                                                      const std::vector<std::uint64_t>* of,
                                                      const std::set<std::string>& without) const {
    std::vector<MeshProperty> out;
    const auto found = piece_.sections.find(section);
    if (found == piece_.sections.end()) return out;
    std::set<std::string> taken = without;
    taken.insert("");
    for (const VtkArray& array : found->second) {
        if (!taken.insert(array.name).second) continue;
        std::uint64_t expected = 0;
        if (array.components < 1 || array.components > 1000 ||
            __builtin_mul_overflow(tuples, array.components, &expected))
            fail(fmt::format("array {} has {} components", in_quotes(array.name), array.components));
        const VtkValues all = vtk_values(array, encoding_, expected, file_);
        const std::size_t n = array.components, count = of ? of->size() : tuples;
        MeshProperty p{array.name, static_cast<int>(n), {}};
        const bool bytes = array.type.kind == 'u' && array.type.bytes == 1 && is_color(p);
        p.values.resize(n * count);
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t k = 0; k < n; ++k) {
                const float v = all.number((of ? (*of)[i] : i) * n + k);
                p.values[i * n + k] = bytes ? v / 255 : v;
            }
        out.push_back(std::move(p));
    }
    return out;
}

TriMesh read_piece(const VtkPiece& piece, bool poly_data, const VtkEncoding& encoding,
                   const std::string& file, const Progress& progress) {
    const VtkPieceDecoder decoder(piece, encoding, file);
    return SurfaceReader(decoder, progress).read(poly_data);
}

}  // namespace vdbgeo::mesh_formats
