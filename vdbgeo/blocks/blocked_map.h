// A map that does not fit into memory: read block by block, its fields in files.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "vdbgeo/blocks/block_plan.h"
#include "vdbgeo/blocks/brick_index.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/flow/checkpoint_options.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {

/// A map that is read in parts, as often as they are wanted.
struct MapSource {
    openvdb::CoordBBox box;  ///< holds all leaves
    openvdb::math::Transform::ConstPtr transform;
    /// The leaves and tiles that reach into a box, with the values, masks and background of the whole.
    std::function<openvdb::FloatGrid::Ptr(const openvdb::CoordBBox& wanted)> read;
};

struct BlockOptions {
    std::uint64_t memory = 0;       ///< bytes that may be taken for the blocks
    std::filesystem::path scratch;  ///< folder of temporary files
    /// Blocks of this size (at multiples of 32, 32 and 128 voxels) and so many steps; unset: as memory goes.
    std::optional<openvdb::Coord> size;
    std::optional<int> steps;
    CheckpointOptions checkpoint;
};

/// What was made of such a map, in files.
class BlockedResult {
 public:
    virtual ~BlockedResult() = default;
    /// Of the map's values, less some number.
    virtual const stencil::FieldSummary& before() const = 0;
    /// Writes the new values into the leaves of a part, as the source gives it, that begin in `box`. Returns
    /// Σ (X − u)² over their active voxels.
    virtual ExactSum store(const openvdb::CoordBBox& box, openvdb::FloatTree& part) const = 0;
};

/// What those share who go through such a map.
class BlockedMap {
 public:
    BlockedMap(MapSource source, const BlockOptions& options)
        : source_(std::move(source)), options_(options) {}

    const MapSource& source() const { return source_; }
    const BlockOptions& options() const { return options_; }
    const BrickIndex& index() const { return index_; }

    /// Goes through the map once: finds its leaves, and what it holds. InvalidInput for values that are not
    /// finite.
    stencil::FieldSummary survey(const Progress& progress);
    /// The leaves that reach into a box; active tiles as leaves.
    openvdb::FloatGrid::Ptr read(const openvdb::CoordBBox& box) const;
    /// Blocks for some work, in what is left of the memory.
    BlockPlan plan(const BlockWork& work) const;
    /// Blocks in which X is read, and this many fields are in memory.
    BlockPlan reading_plan(int ghosts, int fields = 1) const;
    /// The bricks of a field whose leaves begin in a box.
    struct Field {
        stencil::BlockLayout layout;
        stencil::BlockField values;
    };
    Field field_in(const openvdb::CoordBBox& box, const BrickFile& file) const;

 private:
    MapSource source_;
    BlockOptions options_;
    BrickIndex index_;
};

/// A field in files: what it was, and what it becomes.
struct BrickGenerations {
    std::unique_ptr<BrickFile> now, next;
    /// What was goes: what of it the system did not write to the disk so far, it never will.
    void turn() { now = std::move(next); }
};

/// What next values are written to; made where it is not there.
BrickFile& next_of(BrickGenerations& field, const std::filesystem::path& scratch);

/// The box and so many voxels around it.
openvdb::CoordBBox grown(openvdb::CoordBBox box, int by);

}  // namespace vdbgeo
