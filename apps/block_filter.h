// What commands share that make a map out of a map which does not fit into the memory that may be taken.
#pragma once

#include <memory>
#include <string>

#include "apps/map_filter.h"
#include "converters/map_blocks.h"
#include "vdbgeo/blocks/blocked_diffusion.h"

namespace vdbgeo::app {

/// Whether the map is to be filtered block by block: a folder of parts, or a map file of which all samples, as
/// its header tells them, would take more than --memory. Samples that a threshold keeps count as all where
/// --memory is given; else they are counted once they are read.
bool in_blocks(const MapFilterFlags& flags, const MemoryNeed& need);

class BlockFilter {
 public:
    /// Opens the map and says what is odd about it.
    BlockFilter(const MapFilterFlags& flags, Session& session);

    const MapFile& in() const { return map_.whole(); }
    MapSource source() const;
    BlockOptions options() const;
    /// NumericalError where the solver is null: no sample is kept.
    void need_solver(const std::unique_ptr<BlockedDiffusion>& solver) const;
    /// Takes the solver's values for the map's. `cleared`: clear_inactive.
    void finish(const BlockedDiffusion& solver, bool cleared, const std::string& history,
                const Progress& progress);
    const Statistics& statistics() const { return result_.statistics; }
    /// Writes the map and puts what there is to say of the file into the result.
    void write(Json& result, Session& session) const;

 private:
    openvdb::FloatGrid::Ptr changed(const openvdb::CoordBBox& slab) const;

    const MapFilterFlags& flags_;
    MapBlocks map_;
    DensityMap result_;  // without voxels
    const BlockedDiffusion* solver_ = nullptr;
    bool cleared_ = false;
};

}  // namespace vdbgeo::app
