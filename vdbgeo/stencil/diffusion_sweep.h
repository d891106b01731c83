// Several steps of u_t = −Σ_q L_{d_q} L^q u + β (target − u) with frozen coefficients in one pass over
// memory.
#pragma once

#include <functional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/types.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

/// −L_{d} L^q. `diffusivity` has `inactive` (plane_kernels.h) in voxels that are not active; null: 1
/// everywhere. `factor` multiplies it.
struct SweepTerm {
    int order = 0;
    const float* diffusivity = nullptr;
    double factor = 1;
};

/// A field that moves on in place, through a window twice a slab wide: see ShiftedField.
class ShiftedField {
 public:
    ShiftedField() = default;
    explicit ShiftedField(const BlockLayout& layout);

    const float* now() const { return field_.brick(forward_ ? shift_ : 0); }
    float* now() { return field_.brick(forward_ ? shift_ : 0); }
    /// Where the next values go. A slab may be written once the slab before the last one, in the order of
    /// `forward`, is no longer needed.
    float* next() { return field_.brick(forward_ ? 0 : shift_); }
    /// Whether slabs are gone through from the first to the last.
    bool forward() const { return forward_; }
    void turn() { forward_ = !forward_; }
    std::size_t memory() const { return field_.memory(); }
    /// All of its memory, what is written next too.
    BlockField& all() { return field_; }

 private:
    BlockField field_;
    std::size_t shift_ = 0;
    bool forward_ = true;
};

/// One of the fields that are stepped together.
struct SweepField {
    std::vector<SweepTerm> terms;    ///< by order, ascending; at least one
    ShiftedField* state = nullptr;   ///< u_k, becomes u_{k+n}
    ShiftedField* before = nullptr;  ///< u_{k−1}, becomes u_{k+n−1}
    double coupling = 0;             ///< β ≥ 0
    const float* target = nullptr;   ///< bricks of what u is drawn to; null: the other field
};

struct SweepPlan {
    Vec3d weights = Vec3d::Ones();   ///< w_a of the axes
    std::vector<SweepField> fields;  ///< one or two
    /// α and τ of each step: u_{k+1} = α (u_k + τ A u_k) + (1 − α) u_{k−1}.
    struct Step {
        double relaxation = 1, tau = 0;
    };
    std::vector<Step> steps;
    bool begins = true;  ///< u_{k−1} = u_k: `before` is not read
    bool ends = true;    ///< `before` is not wanted and not written
    /// Called for each slab of the layout before anything of it is read, and once it is written: all slabs
    /// from the first to the last where `state` goes forward, else from the last to the first.
    std::function<void(std::size_t slab)> before_slab, after_slab;
    /// Called now and then by the thread that sweeps, some milliseconds apart.
    std::function<void()> meanwhile;
};

/// The number of steps that fit into one pass for operators up to this order.
int steps_per_sweep(int max_order);
/// How far, in voxels, those steps look.
int sweep_halo(int max_order);

/// Takes the steps, all in one pass: each tile is read with a halo of steps · (order + 1) voxels, taken
/// through all of them in cache, plane behind plane, and written once. Face between an active voxel and
/// another: no flux (METHODS: the band-edge rule). Bitwise the same for any number of threads. `state` and
/// `before` are turned.
void sweep(const BlockLayout& layout, SweepPlan& plan, const Progress& progress = {});

}  // namespace vdbgeo::stencil
