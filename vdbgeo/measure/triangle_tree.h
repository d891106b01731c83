// Nearest points on a mesh.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A tree of boxes over a mesh's triangles: each node holds the boxes of four children, and the triangles are
/// put in such an order that node i of a level covers the 4^level·4 triangles from i·4^level·4 on (halving by
/// centroids along the longest side). Keeps a copy of what it needs of the mesh, about 72 bytes a face.
/// Queries may come from any thread. The tree and the answers are the same for any number of threads. Built
/// in O(n log n); a query near the surface takes O(log n), under a microsecond on 150 000 faces.
class TriangleTree {
 public:
    struct Nearest {
        Vec3d point;             ///< on the mesh
        std::uint64_t face = 0;  ///< the lowest-numbered of those that are equally near
        double squared_distance =
            std::numeric_limits<double>::infinity();  ///< infinite: nothing within reach
    };

    /// A mesh without faces is allowed: nothing is ever near. Faces without an area count as the segments or
    /// points that they are. Throws InvalidInput for a mesh that `check` refuses, and for 2^32 faces or more.
    explicit TriangleTree(const TriMesh& mesh);

    /// The nearest point of the mesh among those within √`squared_reach` (which still counts). The distance
    /// is computed in double precision and is that from p to `point`; faces are equally near when their
    /// computed distances have the same bits.
    Nearest nearest(const Vec3d& p, double squared_reach = std::numeric_limits<double>::infinity()) const;

 private:
    struct Box4 {
        float low[3][4], high[3][4];
    };
    struct Face {
        float corners[3][3];
        std::uint32_t number;
    };
    struct Search;

    void bound_faces();
    void bound_nodes();
    void visit_leaf(Search& search, std::uint32_t node) const;

    Array<Face> faces_;                ///< in the tree's order
    std::vector<Array<Box4>> levels_;  ///< [0]: boxes of single triangles, four a node; the last has one node
};

}  // namespace vdbgeo
