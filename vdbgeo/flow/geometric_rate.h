// The right side of Eq 5, and how long a step it allows.
#pragma once

#include <array>

#include "vdbgeo/flow/geometric_flow.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo {

class GeometricRate {
 public:
    GeometricRate(const GeometricFlowOptions& options, const Vec3d& weights);

    /// rate = S_t in the layout's own cells. Returns the largest row sum √g Σ w/√g over the faces of a voxel
    /// there. `input`: X, where there is a fidelity.
    double operator()(const stencil::BlockLayout& layout, const float* state, const float* input,
                      float* rate) const;
    /// The longest stable step, from the largest row sum of the whole map.
    double bound(double row_sum) const;
    /// Voxels that the rate of a voxel looks around it.
    int reach() const { return options_.order + 1; }

 private:
    GeometricFlowOptions options_;
    Vec3d weights_;
};

}  // namespace vdbgeo
