#include "vdbgeo/core/mesh_subset.h"

#include <algorithm>

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;

/// Moves the elements that stay to the front, in order.
template <class Values>
void compact(Values& values, std::size_t width, const std::vector<bool>& gone) {
    std::size_t to = 0;
    for (std::size_t e = 0; e < gone.size(); ++e) {
        if (gone[e]) continue;
        for (std::size_t c = 0; c < width; ++c) values[to++] = values[width * e + c];
    }
    values.resize(to);
}

void compact(std::vector<MeshProperty>& properties, const std::vector<bool>& gone) {
    for (MeshProperty& p : properties) compact(p.values, static_cast<std::size_t>(p.components), gone);
}

std::vector<MeshProperty> picked(const std::vector<MeshProperty>& from,
                                 const std::vector<std::uint32_t>& elements) {
    std::vector<MeshProperty> all;
    for (const MeshProperty& p : from) {
        const auto n = static_cast<std::size_t>(p.components);
        MeshProperty q{p.name, p.components, {}};
        q.values.reserve(n * elements.size());
        for (const std::size_t e : elements)
            for (std::size_t c = 0; c < n; ++c) q.values.push_back(p.values[n * e + c]);
        all.push_back(std::move(q));
    }
    return all;
}

}  // namespace

TriMesh pick_faces(const TriMesh& mesh, const std::vector<std::uint32_t>& faces) {
    std::vector<std::uint32_t> place(mesh.points.size(), none), vertices;
    for (const std::uint32_t f : faces)
        for (const VertexId v : mesh.triangles[f]) place[v] = 0;
    for (std::size_t v = 0; v < place.size(); ++v) {
        if (place[v] == none) continue;
        place[v] = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(static_cast<std::uint32_t>(v));
    }
    TriMesh part;
    part.points.reserve(vertices.size());
    for (const std::uint32_t v : vertices) part.points.push_back(mesh.points[v]);
    part.triangles.reserve(faces.size());
    for (const std::uint32_t f : faces) {
        const Triangle& t = mesh.triangles[f];
        part.triangles.push_back({place[t[0]], place[t[1]], place[t[2]]});
    }
    part.vertex_properties = picked(mesh.vertex_properties, vertices);
    part.face_properties = picked(mesh.face_properties, faces);
    return part;
}

std::uint64_t remove_faces(TriMesh& mesh, const std::vector<bool>& flags) {
    const std::size_t before = mesh.triangles.size();
    if (std::find(flags.begin(), flags.end(), true) == flags.end()) return 0;
    compact(mesh.triangles, 1, flags);
    compact(mesh.face_properties, flags);
    return before - mesh.triangles.size();
}

std::uint64_t remove_unused_vertices(TriMesh& mesh) {
    std::vector<bool> unused(mesh.points.size(), true);
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t) unused[v] = false;
    std::vector<VertexId> place(mesh.points.size());
    VertexId used = 0;
    for (std::size_t v = 0; v < place.size(); ++v) {
        place[v] = used;
        used += !unused[v];
    }
    const std::size_t count = mesh.points.size() - used;
    if (count == 0) return 0;
    for (Triangle& t : mesh.triangles)
        for (VertexId& v : t) v = place[v];
    compact(mesh.points, 1, unused);
    compact(mesh.vertex_properties, unused);
    return count;
}

}  // namespace vdbgeo
