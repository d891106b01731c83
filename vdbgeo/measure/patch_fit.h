// One fit of the adaptive method: a jet over the sphere that osculates a patch.
#pragma once

#include <cstddef>
#include <vector>

#include "vdbgeo/measure/fit_surface.h"
#include "vdbgeo/measure/jet_fit.h"
#include "vdbgeo/measure/vertex_patch.h"

namespace vdbgeo {

struct FittedCurvature {
    double k1 = 0, k2 = 0;         ///< k1 ≥ k2
    Vec3d direction1, direction2;  ///< unit, tangent
    Vec3d normal;
    int degree = 0;  ///< of the jet: lower than asked for where points were too few
};

/// Fits around vertex after vertex; one object a thread.
class PatchFit {
 public:
    explicit PatchFit(const FitSurface& surface);

    /// To the vertices in a ball, weighted by their areas and (1 − d²/r²)²; false where nothing fits.
    bool ball(VertexId v, double radius, int degree, FittedCurvature& out);
    /// To the vertices within k edges, weighted by (1 − (ring/(k + 1))²)³: for even meshes whose edges are
    /// longer one way than the other.
    bool rings(VertexId v, int k, int degree, FittedCurvature& out);

    /// The sphere through two rings, whichever way they face, for pieces of a few faces: equal curvatures.
    bool sphere(VertexId v, FittedCurvature& out);

 private:
    struct Point {
        Vec3d at;
        double weight;
    };

    void gather(VertexId v, const std::vector<VertexPatch::Member>& members, double radius, int rings);
    bool fit(int degree, FittedCurvature& out);
    bool find_sphere();
    Vec3d flattened(const Vec3d& p) const;
    template <int Degree>
    bool fit_jet(FittedCurvature& out);

    const FitSurface& surface_;
    VertexPatch patch_;
    std::vector<Point> points_;  // in the frame of the vertex's normal, over the radius
    TangentFrame frame_;         // of the normal
    TangentFrame turned_;        // of the sphere, in the frame above
    Vec3d foot_;                 // the point of the sphere nearest to the vertex
    double bend_ = 0;            // curvature of the sphere, radii⁻¹
    double scale_ = 1;           // 1/radius
};

}  // namespace vdbgeo
