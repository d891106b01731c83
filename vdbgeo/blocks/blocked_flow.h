// A geometric flow of a map that does not fit into memory.
#pragma once

#include <memory>

#include "vdbgeo/blocks/blocked_map.h"
#include "vdbgeo/flow/flow_steps.h"
#include "vdbgeo/flow/geometric_rate.h"

namespace vdbgeo {

/// geometric_flow's values, to the bit, whatever the blocks. The bound of a step is that of the whole map, so
/// one step is taken at a time: a pass over the map, in which each block takes it with ghosts of 2 (q+1)
/// voxels and finds the bound of the next. Between steps S is in temporary files.
class BlockedFlow : public FlowSteps, public BlockedResult {
 public:
    /// Goes through the map twice. Errors as geometric_flow; NumericalError where the memory is too small.
    BlockedFlow(MapSource source, const GeometricFlowOptions& options, const BlockOptions& blocks,
                const Progress& progress = {});

    double bound() override { return rate_of_.bound(row_sum_); }
    stencil::FieldSummary take(double dt) override;

    const stencil::FieldSummary& before() const override { return before_; }
    std::size_t blocks() const { return plan_.blocks.size(); }
    std::size_t memory() const { return memory_ + map_.index().memory(); }
    ExactSum store(const openvdb::CoordBBox& box, openvdb::FloatTree& part) const override;

 private:
    void take_block(const openvdb::CoordBBox& own, float dt, stencil::FieldTotal& total, double& row_sum);
    void find_first_bound(const Progress& progress);

    GeometricFlowOptions options_;
    BlockedMap map_;
    GeometricRate rate_of_;
    stencil::FieldSummary before_;
    BlockPlan plan_;
    BrickGenerations state_;  // `now` is null where S = X
    double row_sum_ = 0;
    std::size_t memory_ = 0;
};

/// geometric_flow of such a map; what it made is then in the result. What was removed is found when it is
/// stored, and not in the report. Null where no voxel is active.
std::unique_ptr<BlockedFlow> geometric_flow_blocks(const MapSource& source,
                                                   const GeometricFlowOptions& options,
                                                   const BlockOptions& blocks, HyperdiffusionReport& report,
                                                   const Progress& progress = {});

}  // namespace vdbgeo
