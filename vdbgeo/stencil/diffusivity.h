// The diffusivity of Eqs 3 and 4: small where the gradient is large.
#pragma once

#include <array>

#include "vdbgeo/core/exact_sum.h"
#include "vdbgeo/core/types.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

struct Tile;

struct Diffusivity {
    double factor = 1;  ///< d_q0
    /// Window of the local variance that gives σ²: radius 1…8; 0: `sigma_squared` everywhere.
    int radius = 2;
    bool of_gradient =
        false;  ///< the variance is that of ∇u, summed over its components (q ≥ 1), not that of u
    double sigma_squared = 0;  ///< > 0 where radius is 0
    double scale = 1;          ///< multiplies the local σ²
    double floor = 0;          ///< σ² is at least this, > 0
};

/// out = factor · exp(−|∇u|²/2σ²) in active voxels, `inactive` in the others; the gradient's components times
/// √w_a. Variances are those of a population, over the active voxels of the window.
void diffusivity(const BlockLayout& layout, const float* u, const Vec3d& weights, const Diffusivity& options,
                 float* out);

/// Variance of ∇u over the active voxels of the grid, summed over its components times √w_a; of all members
/// where there is a team.
double gradient_variance(const BlockLayout& layout, const float* u, const Vec3d& weights,
                         Team* team = nullptr);

/// The same of a field that comes in parts, in any order, which have their voxels' neighbours. A layout works
/// on whole cells along x and z here, and on whole leaves along y.
class GradientTotal {
 public:
    explicit GradientTotal(const Vec3d& weights) : weights_(weights) {}
    void add(const BlockLayout& layout, const float* u);
    double variance(Team* team = nullptr) const;

 private:
    void add_tile(Tile& t, const float* scale);

    Vec3d weights_;
    std::uint64_t active_ = 0;
    ExactSum square_;
    std::array<ExactSum, 3> component_;
};

}  // namespace vdbgeo::stencil
