#include "vdbgeo/core/vertex_neighbours.h"

#include <algorithm>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

VertexNeighbours::VertexNeighbours(const TriMesh& mesh) {
    const std::size_t points = mesh.points.size();
    // Every face names each of its edges once to either end: an inner edge comes twice in each list.
    Array<std::uint64_t> first;
    first.assign(points + 1, 0);
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t) first[v + 1] += 2;
    for (std::size_t v = 0; v < points; ++v) first[v + 1] += first[v];
    Array<VertexId> all(first[points]);
    Array<std::uint64_t> place(first.begin(), first.end());
    for (const Triangle& t : mesh.triangles)
        for (std::size_t i = 0; i < 3; ++i)
            for (const std::size_t j : {(i + 1) % 3, (i + 2) % 3}) all[place[t[i]]++] = t[j];
    fixed.assign(points, 0);
    begin.assign(points + 1, 0);
    parallel_for(points, 1024, [&](std::size_t v) {
        VertexId* from = all.data() + first[v];
        VertexId* to = all.data() + first[v + 1];
        std::sort(from, to);
        VertexId* kept = from;
        for (VertexId* w = from; w != to;) {
            VertexId* end = std::upper_bound(w, to, *w);
            if (end - w != 2) fixed[v] = 1;
            *kept++ = *w;
            w = end;
        }
        begin[v + 1] = static_cast<std::uint64_t>(kept - from);
    });
    for (std::size_t v = 0; v < points; ++v) begin[v + 1] += begin[v];
    neighbours.resize(begin[points]);
    parallel_for(points, 1024, [&](std::size_t v) {
        std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(first[v]), begin[v + 1] - begin[v],
                    neighbours.begin() + static_cast<std::ptrdiff_t>(begin[v]));
    });
    const MeshProperty* cap = mesh.find_face_property(cap_property);
    if (!cap || cap->components != 1) return;
    Array<char> sides;
    sides.assign(points, 0);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        for (const VertexId v : mesh.triangles[f])
            sides[v] = static_cast<char>(sides[v] | (cap->values[f] > 0.5f ? 1 : 2));
    for (std::size_t v = 0; v < points; ++v)
        if (sides[v] == 3) fixed[v] = 1;
}

}  // namespace vdbgeo
