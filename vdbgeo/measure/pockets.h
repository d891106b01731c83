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
    /// Pockets: k2 under this, 1/Å. None: −c/2, c the median curvedness of the surface by area: a pocket
    /// bends inward half as sharply as the surface bends at a typical place, or more …
    std::optional<double> k2_below;
    /// Pockets: and k1 not above this, 1/Å (infinity: no bound). None: c: … and outward no more than is
    /// typical, which leaves out necks and the flanks of ridges.
    std::optional<double> k1_below;
    /// Protrusions: k1 above this, 1/Å. None: 2 c, or the 95th percentile of k1 by area where that is less
    /// (a wide gaussian bounds the curvature of a field), but 1.25 c at least: a sphere has none.
    std::optional<double> k1_above;
    /// Å²: smaller patches are roughness. None: the smaller of 1/s², s the larger of |threshold| and c, and
    /// of 20 vertices' mean area.
    std::optional<double> min_area;
    /// 1/Å. None: s. Patches that touch stay apart where both are deeper in curvature than the saddle between
    /// them by this; 0 parts all minima, infinity none that touch.
    std::optional<double> min_persistence;
    /// Depth under the surface that a ball of this radius, Å, rolls on; none: under the convex hull.
    std::optional<double> ambient_radius;

    /// Throws InvalidInput for numbers that are not finite (a persistence may be infinite) or out of range,
    /// and for bounds of the other kind.
    void check() const;
};

/// Means are by area.
struct Pocket {
    std::uint32_t id = 0;  ///< from 1, by rank
    std::uint64_t vertices = 0;
    double area_A2 = 0;  ///< of the vertices' shares
    Vec3d centroid = Vec3d::Zero();
    double mean_k1 = 0, mean_k2 = 0, mean_H = 0, mean_K = 0;
    double extreme_k = 0;  ///< the least k2 of a pocket, the greatest k1 of a protrusion
    VertexId extreme_vertex = 0;
    double depth_A = 0, mean_depth_A = 0;  ///< of its vertices: the greatest and the mean
    /// Closed lines around it, pinholes not counted: 0 the wall of a cavity, 1 a pit, 2 a channel or a
    /// groove.
    std::uint32_t rims = 0;
    double mouth_length_A = 0;  ///< of these
    double mouth_area_A2 = 0;   ///< of the rim that spans most: the length of its area vector
    /// Unit direction of that area vector: out of the mouth of a pocket, towards the tip of a protrusion.
    /// Zero where there is no rim.
    Vec3d opening = Vec3d::Zero();
    bool touches_border =
        false;  ///< ends at a border, a cap, or where curvature is undefined: may go on there
    /// What the rank is by. Pockets: ∫ depth dA, Å³, the space between patch and hull or ball. Protrusions:
    /// ∫ (k1 − threshold) dA, Å.
    double score = 0;
};

struct Pockets {
    std::vector<Pocket> list;  ///< by falling score, of equals the lower extreme_vertex first
    Array<std::uint32_t> id;   ///< of each vertex, 0: none
    // The bounds used.
    double threshold = 0;  ///< pockets: k2_below; protrusions: k1_above
    double k1_below = 0;   ///< infinite for protrusions
    double min_area = 0, min_persistence = 0;
    double area_A2 = 0;  ///< of the surface, caps left out
};

/// The patches of a surface with k2 below a bound (pockets) or k1 above one (protrusions): §3.3.1, Figs 13
/// and 14 of the paper (Feng, Xia, Tong, Wei 2012, doi:10.1002/cnm.2532), where large negative k2 marks pits
/// and valleys, where small compounds may bind. Vertices that pass, connected through edges, form patches,
/// parted at saddles by persistence (sublevel_basins, on k2 or −k1); patches under the least area are
/// dropped. Depths are those of hull_depths or ambient_depths, rims those of patch_rims on the line of the
/// threshold.
///
/// Vertices with flags (border, cap, undefined) and values that are not finite are in no patch. Any mesh will
/// do for which there is curvature; no patch is an empty list, and where the surface has no curvature at all
/// there is none; where most of it is flat, c is the median over the rest.
///
/// Throws InvalidInput for bad options, a mesh that check() refuses, curvature of another size, and without
/// CGAL where no ambient radius is given and there is a patch; Cancelled. Deterministic. Cost: O(n log n);
/// 100 bytes a vertex in a patch and 30 a vertex, and the trees for the depths.
Pockets find_pockets(const TriMesh& mesh, const Curvatures& curvature, const PocketOptions& options = {},
                     const Progress& progress = {});

/// The mean of a value of the vertices (local resolution, say) over each patch, weighted by `areas`
/// (vertex_areas); what is not finite is left out, NaN where nothing is left. In the order of the list.
/// Throws InvalidInput where the sizes differ. Cost: O(n).
std::vector<double> means_over(const Pockets& pockets, const std::vector<float>& values,
                               const Array<double>& areas);

}  // namespace vdbgeo
