// The part of a mesh around a vertex: rings, balls, geodesic discs.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/vertex_neighbours.h"

namespace vdbgeo {

/// Finds the vertices around one after another; one object a thread. Only vertices that are joined to the
/// centre by edges within the patch are found, so another sheet of the surface that happens to be near is
/// not. The order of what is found depends on the mesh alone.
class VertexPatch {
 public:
    VertexPatch(const TriMesh& mesh, const VertexNeighbours& neighbours);

    struct Member {
        VertexId vertex;
        float distance;  ///< rings: number of edges; ball: straight; geodesic: along the edges, Å
    };

    /// Within k edges of v, by rising number of edges; the first is v.
    const std::vector<Member>& rings(VertexId v, int k);
    /// Within a straight distance of v; the first is v, the rest in order of finding.
    const std::vector<Member>& ball(VertexId v, double radius);
    /// Within a distance along the surface, by rising distance.
    const std::vector<Member>& geodesic(VertexId v, double radius);

 private:
    const TriMesh& mesh_;
    const VertexNeighbours& neighbours_;
    std::vector<Member> members_;
};

}  // namespace vdbgeo
