// A map whose leaves are found one by one, wherever they are → files.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <functional>

#include "converters/mrc.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {

struct LeafSource {
    Frame frame;
    openvdb::MetaMap meta;
    /// Where it is set: what becomes of the metadata of a VDB file once all leaves were asked for.
    std::function<void(openvdb::MetaMap&)> finish_meta;
    openvdb::math::Transform::ConstPtr transform;
    float background = 0;
    openvdb::CoordBBox active_box;  ///< is looked at where the frame has no box

    /// What there is at a leaf's first voxel: a leaf, valid until the next call, or 8³ voxels of one value.
    struct Found {
        const leaf::Leaf* leaf = nullptr;
        float tile = 0;
        bool on = false;  ///< the tile is active
    };
    using Finder = std::function<Found(const openvdb::Coord& corner)>;
    /// A finder for one thread. All threads ask for the leaves of one slab of 8 sections, and then for those
    /// of the next.
    std::function<Finder()> finder;
};

/// Finders for a map that is read slab by slab: `read` gives the leaves and tiles of 8 sections along `axis`
/// (0 x, 1 y, 2 z) that a box spans, and one slab is held. To be called from any thread.
std::function<LeafSource::Finder()> slab_finder(
    int axis, const openvdb::CoordBBox& box,
    std::function<openvdb::FloatGrid::Ptr(const openvdb::CoordBBox& slab)> read);

/// Writes the whole as write_mrc does, to the same bytes: eight sections in memory.
MrcWriteReport write_mrc(const LeafSource& map, const std::filesystem::path& path,
                         const MrcWriteOptions& options = {}, const Progress& progress = {});
/// Writes the whole as write_vdb does, to the same bytes; slabs follow each other along z. `memory`: bytes of
/// packed leaves to hold, the rest goes through a temporary file in `scratch` (StreamedGrid).
void write_vdb(const LeafSource& map, const std::filesystem::path& path, const VdbWriteOptions& options,
               std::uint64_t memory, const std::filesystem::path& scratch, const Progress& progress = {});

}  // namespace vdbgeo
