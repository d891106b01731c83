// How wide a neighbourhood the adaptive method fits, and how it finds out.
#pragma once

#include <vector>

#include "vdbgeo/measure/patch_fit.h"

namespace vdbgeo {

/// A neighbourhood and the degree of the jet over it.
struct FitScale {
    int degree = 2;
    int rings = 0;          ///< so many rings of edges; 0: a ball
    double width = 0;       ///< of the ball, in mesh spacings (in rings where there are rings)
    bool absolute = false;  ///< the width is in Å

    double radius(double spacing) const { return absolute ? width : width * spacing; }
};

/// Fits at one scale after another; see adaptive_curvature for the choice.
class ScaledFits {
 public:
    /// `spacing` of the mesh at each vertex, Å.
    ScaledFits(const FitSurface& surface, Array<float> spacing);

    const FitSurface& surface() const { return surface_; }
    /// The ball's radius; for k rings k spacings.
    double radius(VertexId v, const FitScale& s) const { return s.radius(static_cast<double>(spacing_[v])); }

    /// The width of balls in spacings, the median where it varies.
    double relative_width(const FitScale& s) const {
        return s.absolute && median_ > 0 ? s.width / median_ : s.width;
    }
    double median_spacing() const { return median_; }

    /// False where the points do not determine the jet.
    bool fit(PatchFit& patch, VertexId v, const FitScale& s, FittedCurvature& out) const;
    /// The same, and where that fails wider, then of degree 2, then over rings, then a sphere.
    bool fit_anyhow(PatchFit& patch, VertexId v, const FitScale& s, FittedCurvature& out) const;

    struct Choice {
        FitScale scale;
        double change;  ///< of the estimates from this scale to the next, in proportion
        double score;   ///< the change, wider ones a little favoured
    };
    /// The scale whose estimates at some hundreds of vertices change least, in proportion, when it grows by
    /// √2. Stops where they change by less than `enough`; degree 4 is tried only where degree 2 leaves more
    /// than `good`.
    Choice choose(const Array<std::uint8_t>& flags, double enough, double good) const;

 private:
    const FitSurface& surface_;
    Array<float> spacing_;
    double median_ = 0;
};

/// At each vertex the edge of the equilateral triangles of which the mesh around has as many vertices per
/// area; where `even`, the mean over the mesh.
Array<float> mesh_spacing(const FitSurface& surface, bool even);

}  // namespace vdbgeo
