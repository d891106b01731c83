// One or two fields on the bricks of a layout, and how a cycle goes over them: what solvers share that differ
// in where the rest of the map is.
#pragma once

#include <openvdb/openvdb.h>

#include <optional>
#include <vector>

#include "vdbgeo/flow/hyperdiffusion.h"
#include "vdbgeo/stencil/diffusion_sweep.h"

namespace vdbgeo {

/// u = X, u_t = −Σ_q L_{d_q} L^q u + β (target − u) for one field or two. With one field the target is X;
/// with two, each is drawn to the other.
struct DiffusionProblem {
    struct Field {
        std::vector<DiffusionTerm> terms;  ///< by order, ascending
        double coupling = 0;               ///< β
    };
    std::vector<Field> fields;
    EdgeScale sigma;
    Vec3d weights;

    /// Sorts the terms, and drops those without a diffusivity.
    DiffusionProblem(std::vector<Field> fields, const EdgeScale& sigma, const Vec3d& weights);

    bool constant_coefficients() const { return sigma.kind == EdgeScale::Kind::infinite; }
    int highest_order() const;
    /// Voxels that the coefficient of a voxel looks around it.
    int reach_of_coefficients() const;
    /// Explicit steps are stable up to this.
    double bound() const;
    /// The step to use: dt, or 0.9 of the largest allowed, which is the bound, and 20 times it for ADI.
    /// InvalidInput for a dt above that.
    double step(Stepper stepper, const std::optional<double>& dt) const;
};

/// What coefficients take from the whole map.
struct EdgeMeasure {
    double range = 0;  ///< largest value of X minus the smallest
    /// σ² without its factor by field and term, where σ is global.
    std::vector<std::vector<double>> variance;
};

/// Some steps of a cycle that go over the fields together.
struct CycleSweep {
    std::vector<stencil::SweepPlan::Step> steps;
    bool begins = true, ends = true;  ///< SweepPlan's
};
/// All of a cycle's.
std::vector<CycleSweep> sweeps_of_cycle(Stepper stepper, int n, double tau, int highest_order);

class DiffusionFields {
 public:
    /// `problem` has to live as long.
    DiffusionFields(const DiffusionProblem& problem, stencil::BlockLayout layout);

    stencil::BlockLayout& layout() { return layout_; }
    const stencil::BlockLayout& layout() const { return layout_; }
    /// Makes all values but those of `now` finite, and nothing flow: for blocks, where voxels that the layout
    /// does not work on are not computed, and what is read of them must not become an infinity. (`inactive`
    /// would: kernels trust full leaves.)
    void clear_rest();
    /// All fields, and the target of one, become X − offset.
    void load(const openvdb::FloatTree& x, float offset);
    /// Whether X is a target, and the target alone.
    bool has_input() const { return !input_.empty(); }
    void load_input(const openvdb::FloatTree& x, float offset);

    float* now(std::size_t field = 0) { return states_[field].now.now(); }
    const float* now(std::size_t field = 0) const { return states_[field].now.now(); }
    float* before(std::size_t field) { return states_[field].before.now(); }
    /// The fields' bricks as they are now; `before`: and as they were a step ago, behind.
    std::vector<float*> states(bool before);
    /// Where a sweep writes them.
    std::vector<const float*> next_states(bool before);
    /// Bricks of the coefficients that vary.
    std::vector<float*> coefficients();

    /// Evaluates the coefficients in the voxels that the layout works on.
    void freeze(const EdgeMeasure& measure);
    stencil::SweepPlan plan(const CycleSweep& sweep);
    /// u += Π_a (I + θ τ A_a)^{-1} τ A u, where A is the whole operator and A_a = Σ_q L_{d,a} L_a^q.
    void implicit_step(double tau);

    /// The first field plus offset, or the difference of two, into the active voxels of a tree that has the
    /// layout's leaves.
    void store(float offset, openvdb::FloatTree& tree) const;
    std::size_t memory() const;
    /// Bytes for a brick, all fields and tables.
    static std::size_t bytes_a_brick(const DiffusionProblem& problem);

 private:
    struct State {
        stencil::ShiftedField now, before;
        std::vector<stencil::BlockField> diffusivities;  // by term; empty with constant coefficients
    };
    void freeze(std::size_t field, const EdgeMeasure& measure);

    const DiffusionProblem& problem_;
    stencil::BlockLayout layout_;
    std::vector<State> states_;
    stencil::BlockField input_;  // X, where it is a target
};

/// Σ (X − offset − u)² over the active voxels of the bricks that a layout works on. The tree has their
/// leaves.
ExactSum squared_change(const stencil::BlockLayout& layout, const openvdb::FloatTree& x, float offset,
                        const float* u);
/// √(sum/count); 0 of nothing.
double root_mean_square(const ExactSum& sum, std::uint64_t count);

}  // namespace vdbgeo
