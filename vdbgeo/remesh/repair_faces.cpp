#include "vdbgeo/remesh/repair_faces.h"

#include <algorithm>
#include <array>
#include <vector>

#include "vdbgeo/core/disjoint_sets.h"
#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 13;

/// Calls find(v, found) for the vertices in parallel and puts what is found together in the order of the
/// vertices.
template <class Found, class Find>
std::vector<Found> collect(std::size_t vertices, const Find& find) {
    std::vector<std::vector<Found>> parts((vertices + block - 1) / block);
    parallel_blocks(vertices, block, [&](std::size_t begin, std::size_t end) {
        VertexStar star;
        for (std::size_t v = begin; v < end; ++v) find(static_cast<VertexId>(v), star, parts[begin / block]);
    });
    std::vector<Found> all;
    for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

using Edge = std::array<VertexId, 2>;

std::vector<Edge> open_edges(const TriMesh& mesh) {
    const VertexFaces faces(mesh);
    return collect<Edge>(mesh.points.size(), [&](VertexId v, VertexStar& star, std::vector<Edge>& found) {
        star.fill(mesh, faces, v);
        star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
            if (last - first == 1 && v < first->other) found.push_back({v, first->other});
        });
    });
}

std::array<float, 3> place_of(const TriMesh& mesh, VertexId v) {
    const Vec3f& p = mesh.points[v];
    return {p.x(), p.y(), p.z()};
}

/// For each vertex of the edges the lowest one of them at the same place; the others are their own.
std::vector<VertexId> first_at_place(const TriMesh& mesh, const std::vector<Edge>& edges) {
    std::vector<VertexId> ends;
    for (const Edge& e : edges) ends.insert(ends.end(), e.begin(), e.end());
    std::sort(ends.begin(), ends.end());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    std::stable_sort(ends.begin(), ends.end(),
                     [&](VertexId a, VertexId b) { return place_of(mesh, a) < place_of(mesh, b); });
    std::vector<VertexId> first(mesh.points.size());
    std::iota(first.begin(), first.end(), 0u);
    for (std::size_t i = 1; i < ends.size(); ++i)
        if (place_of(mesh, ends[i]) == place_of(mesh, ends[i - 1])) first[ends[i]] = first[ends[i - 1]];
    return first;
}

/// Faces on three vertices that others have too.
struct Twin {
    Triangle vertices;  // sorted
    std::uint32_t face;
    bool even;  // runs through them in rising order
};

std::vector<Twin> find_twins(const TriMesh& mesh, const VertexFaces& faces) {
    return collect<Twin>(mesh.points.size(), [&](VertexId v, VertexStar&, std::vector<Twin>& found) {
        std::vector<Twin> own;
        for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f) {
            Triangle t = mesh.triangles[*f];
            std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
            if (t[0] != v) continue;
            const bool even = t[1] < t[2];
            if (!even) std::swap(t[1], t[2]);
            own.push_back({t, *f, even});
        }
        std::sort(own.begin(), own.end(), [](const Twin& a, const Twin& b) {
            return a.vertices != b.vertices ? a.vertices < b.vertices : a.face < b.face;
        });
        for (std::size_t i = 0; i < own.size(); ++i)
            if ((i > 0 && own[i - 1].vertices == own[i].vertices) ||
                (i + 1 < own.size() && own[i + 1].vertices == own[i].vertices))
                found.push_back(own[i]);
    });
}

/// Whether exactly one face besides those on all three vertices lies at each side.
bool closes_a_hole(const TriMesh& mesh, const VertexFaces& faces, const Triangle& t) {
    const auto has = [](const Triangle& face, VertexId v) {
        return std::find(face.begin(), face.end(), v) != face.end();
    };
    for (std::size_t k = 0; k < 3; ++k) {
        const VertexId a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
        std::size_t others = 0;
        for (const std::uint32_t* f = faces.begin(a); f != faces.end(a); ++f)
            others += has(mesh.triangles[*f], b) && !has(mesh.triangles[*f], c);
        if (others != 1) return false;
    }
    return true;
}

}  // namespace

std::uint64_t merge_open_edges(TriMesh& mesh) {
    std::vector<Edge> edges = open_edges(mesh);
    if (edges.size() < 2) return 0;
    const std::vector<VertexId> first = first_at_place(mesh, edges);
    for (Edge& e : edges)
        if (first[e[1]] < first[e[0]]) std::swap(e[0], e[1]);
    const auto key = [&](const Edge& e) { return Edge{first[e[0]], first[e[1]]}; };
    std::stable_sort(edges.begin(), edges.end(),
                     [&](const Edge& a, const Edge& b) { return key(a) < key(b); });
    DisjointSets same(mesh.points.size());
    for (std::size_t i = 1; i < edges.size(); ++i) {
        if (key(edges[i]) != key(edges[i - 1]) || key(edges[i])[0] == key(edges[i])[1]) continue;
        for (const std::size_t end : {0, 1}) same.join(edges[i - 1][end], edges[i][end]);
    }
    std::uint64_t merged = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) merged += same.find(static_cast<VertexId>(v)) != v;
    if (merged > 0)
        for (Triangle& t : mesh.triangles)
            for (VertexId& v : t) v = same.find(v);
    return merged;
}

std::uint64_t remove_duplicate_faces(TriMesh& mesh) {
    const VertexFaces faces(mesh);
    const std::vector<Twin> twins = find_twins(mesh, faces);
    if (twins.empty()) return 0;
    std::vector<bool> gone(mesh.triangles.size(), false);
    for (std::size_t begin = 0, end; begin < twins.size(); begin = end) {
        for (end = begin; end < twins.size() && twins[end].vertices == twins[begin].vertices; ++end) {
            gone[twins[end].face] = end > begin;
        }
        const bool opposite =
            std::any_of(twins.begin() + std::ptrdiff_t(begin), twins.begin() + std::ptrdiff_t(end),
                        [&](const Twin& twin) { return twin.even != twins[begin].even; });
        if (opposite && !closes_a_hole(mesh, faces, twins[begin].vertices)) gone[twins[begin].face] = true;
    }
    return remove_faces(mesh, gone);
}

}  // namespace vdbgeo
