// A grid that knows how to write itself.
#pragma once

#include <openvdb/openvdb.h>

#include "converters/vdb_file.h"

namespace vdbgeo {

/// A grid of floats that write_vdb hands to OpenVDB's archive as it is: neither copied nor wrapped, whatever
/// the options say of half floats.
///
/// The archive copies a grid to add counts to its metadata before they are written, and to add notes for
/// delayed loading, for which it compresses every leaf once more: half the time of writing. It does not do so
/// for types that it does not know. So from the copy to the nodes such a grid goes by another name; by then
/// its own stands in the file. Files without these notes are read by all.
class SelfWritingGrid : public openvdb::FloatGrid {
 public:
    using openvdb::FloatGrid::FloatGrid;

    openvdb::Name type() const final { return being_noted_ ? "notes" : openvdb::FloatGrid::gridType(); }
    openvdb::GridBase::Ptr copyGrid() final { return notes(); }
    openvdb::GridBase::ConstPtr copyGrid() const final { return notes(); }
    void writeTopology(std::ostream& os) const final {
        being_noted_ = false;
        write_nodes(os);
    }

    /// Where to tell how far the writing is.
    void report_to(const Progress& progress) const { progress_ = progress; }

 protected:
    virtual void write_nodes(std::ostream& os) const = 0;
    const Progress& progress() const { return progress_; }

 private:
    /// Metadata, and the counts that the archive adds.
    class Notes : public openvdb::FloatGrid {
     public:
        explicit Notes(const SelfWritingGrid& grid) : openvdb::FloatGrid(grid.background()), grid_(grid) {
            static_cast<openvdb::MetaMap&>(*this) = grid;
        }
        openvdb::Index64 activeVoxelCount() const override { return grid_.activeVoxelCount(); }
        openvdb::CoordBBox evalActiveVoxelBoundingBox() const override {
            return grid_.evalActiveVoxelBoundingBox();
        }
        openvdb::Index64 memUsage() const override { return grid_.memUsage(); }

     private:
        const SelfWritingGrid& grid_;  // outlives the writing
    };
    openvdb::GridBase::Ptr notes() const {
        being_noted_ = true;
        return std::make_shared<Notes>(*this);
    }

    // Neither changes the grid: they are about its being written.
    mutable bool being_noted_ = false;
    mutable Progress progress_;
};

/// The flags of OpenVDB's file format that `options` stand for.
std::uint32_t compression_flags(const VdbWriteOptions& options);

}  // namespace vdbgeo
