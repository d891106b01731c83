// Diffusion of a map that does not fit into memory: block by block, with the values in files between cycles.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "vdbgeo/blocks/blocked_map.h"
#include "vdbgeo/flow/coupled_high_pass.h"
#include "vdbgeo/flow/cycles.h"
#include "vdbgeo/flow/diffusion_fields.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {

/// The same values as DiffusionSolver's, to the bit, whatever the blocks. A block is read with so many ghosts
/// that all steps of a cycle, or some of them, can be taken in it: ghosts lose a rim of q+1 voxels a step.
/// Between cycles the fields are in temporary files, 4 bytes a voxel each, twice. Memory: `memory`, and 64
/// bytes for each leaf that is not full.
class BlockedDiffusion : public CycleSolver, public BlockedResult {
 public:
    /// Goes through the map twice. Errors as DiffusionSolver; NumericalError where the memory is too small.
    BlockedDiffusion(MapSource source, std::vector<DiffusionProblem::Field> fields, const EdgeScale& sigma,
                     const BlockOptions& options, const Progress& progress = {});

    double step(Stepper stepper, const std::optional<double>& dt) const;
    bool constant_coefficients() const override { return problem_.constant_coefficients(); }
    std::uint64_t active_voxels() const override { return before_.count; }
    void cycle(Stepper stepper, int n, double tau, const Progress& progress) override;
    void reset() override;
    double removed() override;
    std::uint64_t input_hash() override { return input_hash_; }
    std::size_t fields() const override { return problem_.fields.size(); }
    void save(StateWriter& writer) override;
    void load(const StateReader& reader) override;
    /// All but what was removed.
    void describe(HyperdiffusionReport& report) const;
    const stencil::FieldSummary& before() const override { return before_; }
    std::size_t most_blocks() const { return most_blocks_; }

    /// What DiffusionSolver::store writes. Of two fields the first is u.
    ExactSum store(const openvdb::CoordBBox& box, openvdb::FloatTree& part) const override;

 private:
    struct Totals;
    struct Part;

    BlockPlan copying_plan(int ghosts) const;
    /// X is a target.
    bool reads_input() const { return problem_.fields.size() == 1 && problem_.fields[0].coupling > 0; }
    BlockWork work_of(Stepper stepper, int n) const;
    void find_edges(const Progress& progress);
    void take_part(const Part& part, const openvdb::CoordBBox& own, Totals& totals);
    void load(const Part& part, const BrickIndex::Part& bricks, const openvdb::CoordBBox& box,
              DiffusionFields& fields) const;
    void put_down(const Part& part, const BrickIndex::Part& bricks, const openvdb::CoordBBox& own,
                  DiffusionFields& fields);
    void keep(const Totals& totals);

    BlockedMap map_;
    DiffusionProblem problem_;
    std::vector<BrickGenerations> now_, step_before_;  // by field
    std::vector<std::unique_ptr<BrickFile>> coefficients_;
    bool is_input_ = true;  // u = X: nothing is in the files
    stencil::FieldSummary before_;
    std::vector<stencil::FieldSummary> summary_;
    EdgeMeasure first_measure_, measure_;
    float offset_ = 0;
    std::uint64_t input_hash_ = 0;
    std::size_t most_blocks_ = 0, most_memory_ = 0;
};

/// hyperdiffuse and coupled_high_pass of such a map; what they made is then in the solver. What was removed
/// is found when it is stored, and not in the report. Null where no voxel is active.
std::unique_ptr<BlockedDiffusion> hyperdiffuse_blocks(const MapSource& source,
                                                      const HyperdiffusionOptions& options,
                                                      const BlockOptions& blocks,
                                                      HyperdiffusionReport& report,
                                                      const Progress& progress = {});
std::unique_ptr<BlockedDiffusion> coupled_high_pass_blocks(const MapSource& source,
                                                           const HighPassOptions& options,
                                                           const BlockOptions& blocks,
                                                           HyperdiffusionReport& report,
                                                           const Progress& progress = {});

}  // namespace vdbgeo
