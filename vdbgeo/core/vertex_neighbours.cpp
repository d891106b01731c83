#include "vdbgeo/core/vertex_neighbours.h"

#include <algorithm>
#include <atomic>
#include <vector>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 12;

/// Every face names each of its edges once to either end: an inner edge comes twice in each list. The lists
/// end at `end`, and begin where that of the vertex before ends; their order is left to chance.
Array<VertexId> edges_from_faces(const TriMesh& mesh, std::vector<std::atomic<std::uint64_t>>& end) {
    const auto for_faces = [&](const auto& body) {
        parallel_for(mesh.triangles.size(), grain, [&](std::size_t f) {
            if (!degenerate(mesh.triangles[f])) body(mesh.triangles[f]);
        });
    };
    for_faces([&](const Triangle& t) {
        for (const VertexId v : t) end[v].fetch_add(2, std::memory_order_relaxed);
    });
    std::uint64_t sum = 0;
    for (auto& e : end) sum += e.exchange(sum, std::memory_order_relaxed);
    Array<VertexId> all(sum);
    for_faces([&](const Triangle& t) {
        for (std::size_t i = 0; i < 3; ++i) {
            const std::uint64_t at = end[t[i]].fetch_add(2, std::memory_order_relaxed);
            all[at] = t[(i + 1) % 3];
            all[at + 1] = t[(i + 2) % 3];
        }
    });
    return all;
}

/// Fixes the vertices between caps and other faces.
void fix_rims(const TriMesh& mesh, Array<char>& fixed) {
    const MeshProperty* cap = mesh.find_face_property(cap_property);
    if (!cap || cap->components != 1) return;
    Array<char> sides;
    sides.assign(fixed.size(), 0);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        for (const VertexId v : mesh.triangles[f])
            sides[v] = static_cast<char>(sides[v] | (cap->values[f] > 0.5f ? 1 : 2));
    for (std::size_t v = 0; v < fixed.size(); ++v)
        if (sides[v] == 3) fixed[v] = 1;
}

}  // namespace

VertexNeighbours::VertexNeighbours(const TriMesh& mesh) {
    const std::size_t points = mesh.points.size();
    std::vector<std::atomic<std::uint64_t>> end(points);
    Array<VertexId> all = edges_from_faces(mesh, end);
    const auto first = [&](std::size_t v) { return v == 0 ? 0 : end[v - 1].load(std::memory_order_relaxed); };
    fixed.assign(points, 0);
    begin.assign(points + 1, 0);
    parallel_for(points, grain, [&](std::size_t v) {
        VertexId* from = all.data() + first(v);
        VertexId* to = all.data() + first(v + 1);
        std::sort(from, to);
        VertexId* kept = from;
        for (VertexId* w = from; w != to;) {
            VertexId* next = std::upper_bound(w, to, *w);
            if (next - w != 2) fixed[v] = 1;
            *kept++ = *w;
            w = next;
        }
        begin[v + 1] = static_cast<std::uint64_t>(kept - all.data()) - first(v);
    });
    for (std::size_t v = 0; v < points; ++v) begin[v + 1] += begin[v];
    neighbours.resize(begin[points]);
    parallel_for(points, grain, [&](std::size_t v) {
        std::copy_n(all.data() + first(v), begin[v + 1] - begin[v], neighbours.data() + begin[v]);
    });
    fix_rims(mesh, fixed);
}

}  // namespace vdbgeo
