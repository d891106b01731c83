// Pockets and protrusions: patches of a surface that curve inward or outward.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

enum class PatchKind { pocket, protrusion };

struct PocketOptions {
    PatchKind kind = PatchKind::pocket;
    std::optional<double> k2_below;  ///< pockets: k2 under this, 1/Å; none: chosen from the surface
    std::optional<double> k1_below;  ///< pockets: and k1 not above this; none: no bound
    std::optional<double> k1_above;  ///< protrusions: k1 above this
    double min_area = 0;             ///< Å²
    double min_persistence = 0;      ///< 1/Å: depth in curvature at which neighbouring patches stay apart
    std::optional<double> ambient_radius;  ///< depth under the surface that a ball of this radius, Å, rolls
                                           ///< on; none: under the convex hull
    void check() const;
};

struct Pocket {
    std::uint32_t id = 0;  ///< from 1, by rank
    std::uint64_t vertices = 0;
    double area_A2 = 0;
    Vec3d centroid = Vec3d::Zero();
    double mean_k1 = 0, mean_k2 = 0, mean_H = 0, mean_K = 0;
    double extreme_k = 0;  ///< the least k2 of a pocket, the greatest k1 of a protrusion
    VertexId extreme_vertex = 0;
    double depth_A = 0, mean_depth_A = 0;
    double mouth_length_A = 0;  ///< of its rim
    double mouth_area_A2 = 0;
    Vec3d opening = Vec3d::Zero();  ///< unit direction out of the mouth
    double score = 0;               ///< what the rank is by
};

struct Pockets {
    std::vector<Pocket> list;  ///< by falling score
    Array<std::uint32_t> id;   ///< of each vertex, 0: none
    double threshold = 0;      ///< the bound used
};

Pockets find_pockets(const TriMesh& mesh, const Curvatures& curvature, const PocketOptions& options = {},
                     const Progress& progress = {});

}  // namespace vdbgeo
