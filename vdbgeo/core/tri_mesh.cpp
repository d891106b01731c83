#include "vdbgeo/core/tri_mesh.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

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

}  // namespace

const MeshProperty* TriMesh::find_vertex_property(const std::string& name) const {
    return find(vertex_properties, name);
}

const MeshProperty* TriMesh::find_face_property(const std::string& name) const {
    return find(face_properties, name);
}

void check(const TriMesh& mesh, const std::string& what) {
    if (mesh.points.size() > TriMesh::max_vertices)
        throw InvalidInput(fmt::format("{}: {} vertices, more than 2^32-1", what, mesh.points.size()));
    for (std::size_t i = 0; i < mesh.points.size(); ++i)
        if (!mesh.points[i].allFinite())
            throw InvalidInput(
                fmt::format("{}: vertex {} has a coordinate that is not a finite number", what, i));
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        for (const VertexId v : mesh.triangles[f])
            if (v >= mesh.points.size())
                throw InvalidInput(
                    fmt::format("{}: face {} names vertex {} of {}", what, f, v, mesh.points.size()));
    check_sizes(mesh.vertex_properties, mesh.points.size(), what);
    check_sizes(mesh.face_properties, mesh.triangles.size(), what);
}

}  // namespace vdbgeo
