// The part of a mesh around a vertex: rings, balls, geodesic discs.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "vdbgeo/core/vertex_neighbours.h"

namespace vdbgeo {

/// Finds the vertices around one after another; one object a thread. Only vertices that are joined to the
/// centre by edges within the patch are found, so another sheet of the surface that happens to be near is
/// not. The order of what is found depends on the mesh alone. A patch of n vertices costs O(n) (rings, ball)
/// or O(n log n) (geodesic) and no allocation once the object has seen its largest; the object takes 4 bytes
/// a vertex of the mesh, and 8 more from the first geodesic patch on. Both arguments must outlive it.
class VertexPatch {
 public:
    VertexPatch(const TriMesh& mesh, const VertexNeighbours& neighbours);

    struct Member {
        VertexId vertex;
        float distance;  ///< rings: number of edges; ball: straight; geodesic: along the edges, Å
    };

    /// Within k edges of v, by rising number of edges; the first is v. What is returned holds until the next
    /// call, here and below.
    const std::vector<Member>& rings(VertexId v, int k);
    /// Within a straight distance of v; the first is v, the rest in order of finding.
    const std::vector<Member>& ball(VertexId v, double radius);
    /// Within a distance along the edges of the surface (Dijkstra), by rising distance, equal ones by number.
    /// Paths along edges are longer than those across faces, by up to 15 % on a mesh of equilateral
    /// triangles.
    const std::vector<Member>& geodesic(VertexId v, double radius);

 private:
    void begin(VertexId v);
    /// Marks w; whether it was not marked in this patch before.
    bool mark(VertexId w) {
        const bool fresh = stamp_[w] != now_;
        stamp_[w] = now_;
        return fresh;
    }
    Vec3d point(VertexId w) const { return mesh_.points[w].cast<double>(); }

    const TriMesh& mesh_;
    const VertexNeighbours& neighbours_;
    std::vector<Member> members_;
    Array<std::uint32_t> stamp_;  // the patch that last saw each vertex
    std::uint32_t now_ = 0;
    Array<double> way_;                              // geodesic: the shortest way found so far
    std::vector<std::pair<double, VertexId>> heap_;  // its front
};

}  // namespace vdbgeo
