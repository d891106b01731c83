// VTK's unstructured grids with tetrahedra.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "converters/mesh_properties.h"
#include "converters/tet_formats.h"
#include "converters/vtk_xml.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::tet_formats {
namespace {

using namespace mesh_formats;

/// The arrays of cells that are no properties: the region of a tetrahedron, or behind a face, and the region
/// before a face.
constexpr const char *region_array = "region", *outside_array = "outside";

// Reading

/// The tetrahedra of one piece.
class GridReader {
 public:
    GridReader(const VtkPieceDecoder& piece, const Progress& progress) : piece_(piece), progress_(progress) {}

    TetSoup read() {
        VtkValues xyz;
        soup_.points.resize(piece_.points(xyz));
        for (std::uint64_t i = 0; i < 3 * soup_.points.size(); ++i)
            soup_.points[i / 3][static_cast<int>(i % 3)] = xyz.real(i);
        progress_.report(0.2);
        const std::uint64_t cells = piece_.count("NumberOfCells");
        piece_.for_each_cell("Cells", cells, {},
                             [&](std::uint64_t c, std::int64_t type, const auto& corners) {
                                 add_cell(type, c, corners);
                                 if (c % report_every == 0) progress_.report(0.5);
                             });
        soup_.vertex_properties = piece_.properties("PointData", soup_.points.size(), nullptr);
        progress_.report(0.7);
        soup_.tet_properties = piece_.properties("CellData", cells, &cell_of_, {region_array, outside_array});
        if (const auto labels = piece_.find("CellData", region_array, cells))
            for (const std::uint64_t cell : cell_of_) soup_.labels.push_back(labels->real(cell));
        return std::move(soup_);
    }

 private:
    void add_cell(std::int64_t type, std::uint64_t number, const std::vector<VertexId>& corners) {
        if (type != tetra && type != quadratic_tetra) {
            if (is_solid(type))
                piece_.fail(fmt::format("cell {} is {}: only tetrahedra are read", number, cell_name(type)));
            soup_.surfaces += type > poly_line;
            return;
        }
        const std::size_t nodes = type == tetra ? 4 : 10;
        if (corners.size() != nodes)
            piece_.fail(fmt::format("cell {} is {} of {} corners", number, cell_name(type), corners.size()));
        soup_.tets.push_back({corners[0], corners[1], corners[2], corners[3]});
        for (std::size_t k = 4; k < nodes; ++k) soup_.add_middle(corners[k]);
        cell_of_.push_back(number);
    }

    const VtkPieceDecoder& piece_;
    const Progress& progress_;
    TetSoup soup_;
    std::vector<std::uint64_t> cell_of_;  // of each tetrahedron
};

/// All pieces as one, in their order.
TetSoup joined(std::vector<TetSoup> parts, const std::string& file) {
    if (parts.empty()) return {};
    if (parts.size() == 1) return std::move(parts[0]);
    TetSoup all;
    const auto common = [&](std::vector<MeshProperty> TetSoup::*properties) {
        std::vector<const std::vector<MeshProperty>*> every;
        for (const TetSoup& part : parts) every.push_back(&(part.*properties));
        return common_properties(every);
    };
    all.vertex_properties = common(&TetSoup::vertex_properties);
    all.tet_properties = common(&TetSoup::tet_properties);
    bool labelled = true;
    for (const TetSoup& part : parts) labelled = labelled && part.labels.size() == part.tets.size();
    for (TetSoup& part : parts) {
        const std::size_t first = all.points.size();
        if (first + part.points.size() > TriMesh::max_vertices)
            throw InvalidInput(fmt::format("{}: more than 2^32-1 points", file));
        all.points.insert(all.points.end(), part.points.begin(), part.points.end());
        for (Tetrahedron t : part.tets) {
            for (VertexId& v : t) v += static_cast<VertexId>(first);
            all.tets.push_back(t);
        }
        for (std::size_t v = 0; v < part.middles.size(); ++v)
            if (part.middles[v]) all.add_middle(first + v);
        if (labelled) all.labels.insert(all.labels.end(), part.labels.begin(), part.labels.end());
        all.surfaces += part.surfaces;
        part = {};
    }
    return all;
}

// Writing

/// The cells: tetrahedra and then faces, as `Index` numbers.
template <class Index>
void add_cells(VtkWriter& writer, const TetMesh& mesh, const char* index) {
    const std::size_t tets = mesh.tets.size(), faces = mesh.faces.size();
    writer.begin("Cells");
    writer.array(index, "connectivity", 1, 4 * tets + 3 * faces, sizeof(Index),
                 [&mesh, tets](std::size_t i, Buffer& buffer) {
                     const VertexId v = i < 4 * tets ? mesh.tets[i / 4][i % 4]
                                                     : mesh.faces[(i - 4 * tets) / 3][(i - 4 * tets) % 3];
                     put(buffer, static_cast<Index>(v));
                 });
    writer.array(index, "offsets", 1, tets + faces, sizeof(Index), [tets](std::size_t i, Buffer& buffer) {
        put(buffer, static_cast<Index>(i < tets ? 4 * (i + 1) : 4 * tets + 3 * (i - tets + 1)));
    });
    writer.array("UInt8", "types", 1, tets + faces, 1, [tets](std::size_t i, Buffer& buffer) {
        put(buffer, static_cast<std::uint8_t>(i < tets ? tetra : triangle));
    });
    writer.end("Cells");
}

/// Regions and properties of the cells.
void add_cell_data(VtkWriter& writer, const TetMesh& mesh) {
    const std::size_t tets = mesh.tets.size(), cells = tets + mesh.faces.size();
    writer.begin("CellData");
    writer.array("Int32", region_array, 1, cells, 4, [&mesh, tets](std::size_t i, Buffer& buffer) {
        put(buffer, i < tets ? mesh.region(i) : mesh.face_regions[i - tets][0]);
    });
    writer.array("Int32", outside_array, 1, cells, 4, [&mesh, tets](std::size_t i, Buffer& buffer) {
        put(buffer, i < tets ? std::int32_t(-1) : mesh.face_regions[i - tets][1]);
    });
    for (const MeshProperty& p : mesh.tet_properties)
        writer.array("Float32", p.name, p.components, cells * static_cast<std::size_t>(p.components), 4,
                     [&p](std::size_t i, Buffer& buffer) {
                         put(buffer,
                             i < p.values.size() ? p.values[i] : std::numeric_limits<float>::quiet_NaN());
                     });
    writer.end("CellData");
}

/// Throws InvalidInput for names that the file cannot hold.
void check_property_names(const TetMesh& mesh, const std::string& name) {
    check_names(mesh.vertex_properties, name, "VTK");
    check_names(mesh.tet_properties, name, "VTK");
    for (const MeshProperty& p : mesh.tet_properties)
        if (p.name == region_array || p.name == outside_array)
            throw InvalidInput(fmt::format(
                "{}: a property of tetrahedra is called '{}', as are their regions", name, p.name));
}

}  // namespace

TetSoup read_vtu(const std::filesystem::path& path, const Progress& progress) {
    const MappedFile file(path);
    const VtkFile vtk = scan_vtk_xml(file);
    std::vector<TetSoup> parts;
    for (const VtkPiece& piece : vtk.pieces) {
        const VtkPieceDecoder decoder(piece, vtk.encoding, file.name());
        if (vtk.poly_data) decoder.fail("PolyData, which has no tetrahedra: expected an UnstructuredGrid");
        parts.push_back(GridReader(decoder, progress).read());
    }
    return joined(std::move(parts), file.name());
}

bool vtu_holds_tets(const std::filesystem::path& path) {
    const MappedFile file(path);
    if (!is_vtk_xml(file.bytes())) return false;
    const VtkFile vtk = scan_vtk_xml(file);
    if (vtk.poly_data) return false;
    for (const VtkPiece& piece : vtk.pieces) {
        if (piece.count("NumberOfCells") == 0) continue;
        const VtkValues types = VtkPieceDecoder(piece, vtk.encoding, file.name()).types();
        for (std::uint64_t c = 0; c < types.size(); ++c)
            if (types.integer(c) == tetra || types.integer(c) == quadratic_tetra) return true;
    }
    return false;
}

void write_vtu(const TetOutput& out) {
    const TetMesh& mesh = out.mesh;
    check_property_names(mesh, out.path.string());
    AtomicFile file(out.path);
    const std::size_t cells = mesh.tets.size() + mesh.faces.size();
    VtkWriter writer(file, "UnstructuredGrid",
                     fmt::format("NumberOfPoints=\"{}\" NumberOfCells=\"{}\"", mesh.points.size(), cells));
    writer.begin("PointData");
    for (const MeshProperty& p : mesh.vertex_properties) writer.property(p);
    writer.end("PointData");
    add_cell_data(writer, mesh);
    writer.begin("Points");
    writer.array("Float64", "Points", 3, mesh.points.size(), 24, [&mesh](std::size_t i, Buffer& buffer) {
        for (const double c : mesh.points[i]) put(buffer, c);
    });
    writer.end("Points");
    constexpr std::uint64_t most = std::numeric_limits<std::int32_t>::max();
    if (mesh.points.size() > most || 4 * mesh.tets.size() + 3 * mesh.faces.size() > most)
        add_cells<std::int64_t>(writer, mesh, "Int64");
    else
        add_cells<std::int32_t>(writer, mesh, "Int32");
    writer.write(out.progress);
    file.commit();
}

}  // namespace vdbgeo::tet_formats
