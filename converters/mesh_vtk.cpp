// VTK's XML files of surfaces: PolyData (.vtp) and unstructured grids whose cells are flat (.vtu).
#include <fmt/format.h>

#include <limits>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/vtk_piece.h"
#include "converters/vtk_xml.h"

namespace vdbgeo::mesh_formats {
namespace {

void add_properties(VtkWriter& writer, const char* section, const std::vector<MeshProperty>& all) {
    bool normals = false;
    for (const MeshProperty& p : all) normals |= p.name == "normal" && p.components == 3;
    writer.begin(section, normals ? " Normals=\"normal\"" : "");
    for (const MeshProperty& p : all) writer.property(p);
    writer.end(section);
}

/// The cells of a section, as `Index` numbers.
template <class Index>
void add_cells(VtkWriter& writer, const TriMesh& mesh, const char* section, const char* index) {
    const std::size_t faces = mesh.triangles.size();
    writer.begin(section);
    writer.array(index, "connectivity", 1, faces, 3 * sizeof(Index), [&mesh](std::size_t i, Buffer& buffer) {
        for (const VertexId v : mesh.triangles[i]) put(buffer, static_cast<Index>(v));
    });
    writer.array(index, "offsets", 1, faces, sizeof(Index),
                 [](std::size_t i, Buffer& buffer) { put(buffer, static_cast<Index>(3 * i + 3)); });
}

void write_xml(const TriMesh& mesh, const Output& out, bool poly_data) {
    check_names(mesh.vertex_properties, out.name, "VTK");
    check_names(mesh.face_properties, out.name, "VTK");
    const std::size_t points = mesh.points.size(), faces = mesh.triangles.size();
    constexpr const char* flat = "NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys";
    VtkWriter writer(
        out.file, poly_data ? "PolyData" : "UnstructuredGrid",
        fmt::format("NumberOfPoints=\"{}\" {}=\"{}\"", points, poly_data ? flat : "NumberOfCells", faces));
    add_properties(writer, "PointData", mesh.vertex_properties);
    add_properties(writer, "CellData", mesh.face_properties);
    writer.begin("Points");
    writer.array("Float32", "Points", 3, points, 12, [&mesh](std::size_t i, Buffer& buffer) {
        for (const float c : mesh.points[i]) put(buffer, c);
    });
    writer.end("Points");
    const char* const section = poly_data ? "Polys" : "Cells";
    constexpr std::uint64_t most = std::numeric_limits<std::int32_t>::max();
    if (points > most || 3 * faces > most)
        add_cells<std::int64_t>(writer, mesh, section, "Int64");
    else
        add_cells<std::int32_t>(writer, mesh, section, "Int32");
    if (!poly_data)
        writer.array("UInt8", "types", 1, faces, 1,
                     [](std::size_t, Buffer& buffer) { put(buffer, std::uint8_t(5)); });
    writer.end(section);
    writer.write(out.progress);
}

}  // namespace

bool is_vtk_xml(std::string_view bytes) {
    const std::size_t first = bytes.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
    return first != bytes.npos && bytes[first] == '<' && bytes.substr(0, 2000).find("<VTKFile") != bytes.npos;
}

TriMesh read_vtk_xml(const MappedFile& file, const Progress& progress) {
    const VtkFile vtk = scan_vtk_xml(file);
    std::vector<TriMesh> parts;
    for (const VtkPiece& piece : vtk.pieces)
        parts.push_back(read_piece(piece, vtk.poly_data, vtk.encoding, file.name(), progress));
    TriMesh mesh = join_parts(std::move(parts), file.name());
    progress.report(0.9);
    return mesh;
}

void write_vtp(const TriMesh& mesh, const Output& out) { write_xml(mesh, out, true); }

void write_vtu(const TriMesh& mesh, const Output& out) { write_xml(mesh, out, false); }

}  // namespace vdbgeo::mesh_formats
