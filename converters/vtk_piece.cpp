#include "converters/vtk_piece.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

/// Cell types of VTK.
enum Cell { vertex = 1, poly_vertex, line, poly_line, triangle, triangle_strip, polygon, pixel, quad };

/// One piece on its way to a mesh.
class PieceReader {
 public:
    PieceReader(const VtkPiece& piece, const VtkEncoding& encoding, const std::string& file,
                const Progress& progress)
        : piece_(piece), encoding_(encoding), file_(file), progress_(progress) {}

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
        take_properties("PointData", mesh_.points.size(), nullptr, mesh_.vertex_properties);
        take_properties("CellData", cells_, &cell_of_, mesh_.face_properties);
        return std::move(mesh_);
    }

 private:
    [[noreturn]] void fail(const std::string& message) const {
        throw InvalidInput(fmt::format("{}: {}", file_, message));
    }
    VtkValues values(const VtkArray& array, std::optional<std::uint64_t> expected) const {
        return vtk_values(array, encoding_, expected, file_);
    }
    VtkValues needed(const char* section, const char* name, std::optional<std::uint64_t> expected) const {
        const VtkArray* const array = piece_.find(section, name);
        if (!array) fail(fmt::format("{}: no array {}", section, in_quotes(name)));
        return values(*array, expected);
    }

    void take_points() {
        const std::uint64_t count = piece_.count("NumberOfPoints");
        if (count > TriMesh::max_vertices) fail(fmt::format("{} points, more than 2^32-1", count));
        if (count == 0) return;
        const VtkArray* const array = piece_.find("Points", nullptr);
        if (!array) fail(fmt::format("{} points, and no array of them", count));
        if (array->components != 3)
            fail(fmt::format("points of {} components, expected 3", array->components));
        const VtkValues xyz = values(*array, 3 * count);
        mesh_.points.resize(count);
        for (std::uint64_t i = 0; i < count; ++i) {
            for (int a = 0; a < 3; ++a)
                mesh_.points[i][a] = xyz.number(3 * i + static_cast<std::uint64_t>(a));
            if (i % report_every == 0) progress_.report(0.2);
        }
    }

    /// The cells of a section, all of one type or, without a type, each of its own; `first`: the number of
    /// the first among all cells.
    void take_cells(const char* section, std::uint64_t count, std::uint64_t first, std::optional<Cell> type) {
        if (count == 0) return;
        const VtkValues ends = needed(section, "offsets", count),
                        corners = needed(section, "connectivity", {});
        std::optional<VtkValues> types;
        if (!type) types = needed(section, "types", count);
        std::int64_t begin = 0;
        for (std::uint64_t c = 0; c < count; ++c) {
            const std::int64_t end = ends.integer(c);
            if (end < begin || static_cast<std::uint64_t>(end) > corners.size())
                fail(fmt::format("{}: cell {} ends at corner {} of {}", section, c, end, corners.size()));
            polygon_.clear();
            for (std::int64_t i = begin; i < end; ++i) {
                const std::int64_t v = corners.integer(static_cast<std::uint64_t>(i));
                if (v < 0 || static_cast<std::uint64_t>(v) >= mesh_.points.size())
                    fail(fmt::format("{}: cell {} names point {} of {}", section, c, v, mesh_.points.size()));
                polygon_.push_back(static_cast<VertexId>(v));
            }
            add_cell(types ? types->integer(c) : std::int64_t(*type), c);
            cell_of_.resize(mesh_.triangles.size(), first + c);
            begin = end;
            if (c % report_every == 0) progress_.report(0.5);
        }
    }

    void add_cell(std::int64_t type, std::uint64_t number) {
        const std::size_t n = polygon_.size();
        if (type >= vertex && type <= poly_line) return;
        if (type > quad || type < vertex)
            fail(fmt::format("cell {} is of type {}: only surfaces are read", number, type));
        if (n < 3 || (type == triangle && n != 3) || ((type == quad || type == pixel) && n != 4))
            fail(fmt::format("cell {} of type {} has {} corners", number, type, n));
        if (type == triangle_strip) {
            for (std::size_t k = 2; k < n; ++k) {
                const VertexId a = polygon_[k - 2], b = polygon_[k - 1], c = polygon_[k];
                mesh_.triangles.push_back(k % 2 == 0 ? Triangle{a, b, c} : Triangle{b, a, c});
            }
            return;
        }
        if (type == pixel) std::swap(polygon_[2], polygon_[3]);
        append_fan(polygon_, mesh_.triangles);
    }

    /// `of`: the element of the file that each element of the mesh comes from, nullptr where they are the
    /// same.
    void take_properties(const char* section, std::uint64_t tuples, const std::vector<std::uint64_t>* of,
                         std::vector<MeshProperty>& properties) const {
        const auto found = piece_.sections.find(section);
        if (found == piece_.sections.end()) return;
        for (const VtkArray& array : found->second) {
            const auto twice = [&](const MeshProperty& p) { return p.name == array.name; };
            if (array.name.empty() || std::any_of(properties.begin(), properties.end(), twice)) continue;
            std::uint64_t expected = 0;
            if (array.components < 1 || array.components > 1000 ||
                __builtin_mul_overflow(tuples, array.components, &expected))
                fail(fmt::format("array {} has {} components", in_quotes(array.name), array.components));
            const VtkValues all = values(array, expected);
            const std::size_t n = array.components, count = of ? of->size() : tuples;
            MeshProperty p{array.name, static_cast<int>(n), {}};
            const bool bytes = array.type.kind == 'u' && array.type.bytes == 1 && is_color(p);
            p.values.resize(n * count);
            for (std::size_t i = 0; i < count; ++i)
                for (std::size_t k = 0; k < n; ++k) {
                    const float v = all.number((of ? (*of)[i] : i) * n + k);
                    p.values[i * n + k] = bytes ? v / 255 : v;
                }
            properties.push_back(std::move(p));
            progress_.report(0.8);
        }
    }

    const VtkPiece& piece_;
    const VtkEncoding& encoding_;
    const std::string& file_;
    const Progress& progress_;
    TriMesh mesh_;
    std::uint64_t cells_ = 0;
    std::vector<std::uint64_t> cell_of_;  // of each triangle
    std::vector<VertexId> polygon_;
};

}  // namespace

TriMesh read_piece(const VtkPiece& piece, bool poly_data, const VtkEncoding& encoding,
                   const std::string& file, const Progress& progress) {
    return PieceReader(piece, encoding, file, progress).read(poly_data);
}

}  // namespace vdbgeo::mesh_formats
