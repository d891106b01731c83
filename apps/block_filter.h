// What commands share that make a map out of a map which does not fit into the memory that may be taken.
#pragma once

#include <functional>
#include <string>

#include "apps/map_filter.h"
#include "converters/map_blocks.h"
#include "vdbgeo/blocks/blocked_map.h"

namespace vdbgeo::app {

/// Whether the map is to be filtered block by block: a folder of parts, or a map file of which all samples,
/// as its header tells them, would take more than --memory. Samples that a threshold keeps count as all where
/// --memory is given; else they are counted once they are read.
bool in_blocks(const MapFilterFlags& flags, const MemoryNeed& need);

class BlockFilter {
 public:
    /// Opens the map and says what is odd about it.
    BlockFilter(const MapFilterFlags& flags, Session& session);

    const MapFile& in() const { return map_.whole(); }
    MapSource source() const;
    BlockOptions options() const;
    /// NumericalError: no sample is kept.
    void fail_empty() const;
    /// Takes for the map's values those that `store` writes into the leaves of a part which begin in a box.
    /// `cleared`: clear_inactive.
    using Store = std::function<void(const openvdb::CoordBBox& box, openvdb::FloatTree& part)>;
    void finish(Store store, bool cleared, const std::string& history);
    /// Writes the map and puts its statistics, and what there is to say of the file, into the result.
    void write(Json& result, Session& session);
    /// Of the new values, once they are written.
    const Statistics& statistics() const { return result_.statistics; }

 private:
    Statistics statistics_by_slabs(const Progress& progress) const;
    openvdb::FloatGrid::Ptr changed(const openvdb::CoordBBox& slab) const;

    const MapFilterFlags& flags_;
    MapBlocks map_;
    DensityMap result_;  // without voxels
    Store store_;
    bool cleared_ = false;
};

}  // namespace vdbgeo::app
