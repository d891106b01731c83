#include "vdbgeo/core/tet_mesh.h"

#include <fmt/format.h>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"

namespace vdbgeo {
namespace {

constexpr VertexId unused = 0xFFFFFFFFu;

const MeshProperty* find(const std::vector<MeshProperty>& properties, const std::string& name) {
    for (const MeshProperty& property : properties)
        if (property.name == name) return &property;
    return nullptr;
}

void check_sizes(const std::vector<MeshProperty>& properties, std::size_t elements, const std::string& what) {
    for (const MeshProperty& p : properties) {
        const std::size_t expected = elements * static_cast<std::size_t>(p.components);
        if (p.components < 1 || p.values.size() != expected)
            throw InvalidInput(fmt::format("{}: property '{}' has {} values where {} are needed", what,
                                           p.name, p.values.size(), expected));
    }
}

template <class Element>
void check_corners(const Array<Element>& elements, std::size_t points, const char* kind,
                   const std::string& what) {
    for (std::size_t e = 0; e < elements.size(); ++e)
        for (const VertexId v : elements[e])
            if (v >= points)
                throw InvalidInput(fmt::format("{}: {} {} names vertex {} of {}", what, kind, e, v, points));
}

}  // namespace

const MeshProperty* TetMesh::find_vertex_property(const std::string& name) const {
    return find(vertex_properties, name);
}

const MeshProperty* TetMesh::find_tet_property(const std::string& name) const {
    return find(tet_properties, name);
}

void check(const TetMesh& mesh, const std::string& what) {
    if (mesh.points.size() > TriMesh::max_vertices)
        throw InvalidInput(fmt::format("{}: {} vertices, more than 2^32-1", what, mesh.points.size()));
    for (std::size_t i = 0; i < mesh.points.size(); ++i)
        if (!mesh.points[i].allFinite())
            throw InvalidInput(
                fmt::format("{}: vertex {} has a coordinate that is not a finite number", what, i));
    check_corners(mesh.tets, mesh.points.size(), "tetrahedron", what);
    check_corners(mesh.faces, mesh.points.size(), "face", what);
    if (!mesh.regions.empty() && mesh.regions.size() != mesh.tets.size())
        throw InvalidInput(
            fmt::format("{}: {} regions for {} tetrahedra", what, mesh.regions.size(), mesh.tets.size()));
    for (std::size_t t = 0; t < mesh.regions.size(); ++t)
        if (mesh.regions[t] < 1)
            throw InvalidInput(fmt::format("{}: tetrahedron {} is in region {}; regions count from 1", what, t,
                                           mesh.regions[t]));
    if (mesh.face_regions.size() != mesh.faces.size())
        throw InvalidInput(fmt::format("{}: {} pairs of regions for {} faces", what,
                                       mesh.face_regions.size(), mesh.faces.size()));
    check_sizes(mesh.vertex_properties, mesh.points.size(), what);
    check_sizes(mesh.tet_properties, mesh.tets.size(), what);
}

void set_faces(TetMesh& mesh) {
    const TetAdjacency adjacency = tet_adjacency(mesh);
    mesh.faces.clear();
    mesh.face_regions.clear();
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (std::size_t k = 0; k < 4; ++k) {
            const std::uint32_t n = adjacency.neighbour[t][k];
            const std::int32_t inside = mesh.region(t);
            const std::int32_t outside = n == TetAdjacency::none ? 0 : mesh.region(n);
            if (outside != 0 && outside <= inside) continue;  // within a region, or told from the other side
            const Tetrahedron& tet = mesh.tets[t];
            Triangle face{};
            for (std::size_t c = 0; c < 3; ++c) face[c] = tet[static_cast<std::size_t>(tet_faces[k][c])];
            mesh.faces.push_back(face);
            mesh.face_regions.push_back({inside, outside});
        }
}

TriMesh boundary_surface(const TetMesh& mesh, std::int32_t region) {
    TriMesh out;
    MeshProperty regions{"region", 1, {}};
    Array<VertexId> number(mesh.points.size());
    std::fill(number.begin(), number.end(), unused);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto [inside, outside] = mesh.face_regions[f];
        if (region == 0 ? outside != 0 : inside != region && outside != region) continue;
        Triangle t = mesh.faces[f];
        if (region != 0 && outside == region) std::swap(t[1], t[2]);
        for (const VertexId v : t) number[v] = 0;
        out.triangles.push_back(t);
        regions.values.push_back(static_cast<float>(region == 0 ? inside : region));
    }
    for (std::size_t v = 0; v < number.size(); ++v) {
        if (number[v] == unused) continue;
        number[v] = static_cast<VertexId>(out.points.size());
        out.points.push_back(mesh.points[v].cast<float>());
    }
    for (Triangle& t : out.triangles)
        for (VertexId& v : t) v = number[v];
    out.face_properties.push_back(std::move(regions));
    return out;
}

}  // namespace vdbgeo
