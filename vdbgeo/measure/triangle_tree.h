// Nearest points on a mesh.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A tree of boxes over a mesh's triangles. Keeps a copy of what it needs of the mesh. Queries may come from any
/// thread.
class TriangleTree {
 public:
    struct Nearest {
        Vec3d point;                ///< on the mesh
        std::uint64_t face = 0;     ///< the lowest-numbered of those that are equally near
        double squared_distance = std::numeric_limits<double>::infinity();  ///< infinite: nothing within reach
    };

    explicit TriangleTree(const TriMesh& mesh);

    /// The nearest point of the mesh among those within √`squared_reach`.
    Nearest nearest(const Vec3d& p,
                    double squared_reach = std::numeric_limits<double>::infinity()) const;
};

}  // namespace vdbgeo
