// A map that is read box after box, for what is larger than memory.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>

#include "converters/map_file.h"
#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// A map in a file, of which parts are read. What read_map tells of the whole is known once it is open; each
/// part has the bits that read_map gives.
///
/// Input: MRC and CCP4 files, packed ones and pipes too (those are unpacked into a file without a name in
/// MapReadOptions::scratch); grids in VDB files; folders of parts (MapParts). Of plain MRC files a read takes
/// the rows of its box, and no others; of VDB files its leaves. One read at a time; it uses all threads.
class MapBlocks {
 public:
    /// Opens the map and makes the passes over all its samples that the options ask for, and one for the
    /// statistics; none for a VDB file that vdbgeo wrote. Errors as read_map. InvalidInput for a folder that
    /// holds no parts; Cancelled.
    explicit MapBlocks(const std::filesystem::path& path, const MapReadOptions& options = {},
                       const Progress& progress = {});
    ~MapBlocks();
    MapBlocks(MapBlocks&&) noexcept;

    /// What read_map tells: frame, statistics, warnings, notes; and the grid without its voxels: name, class,
    /// metadata, transform and background.
    const MapFile& whole() const;
    const Frame& frame() const { return whole().map.frame; }
    /// Over all samples of the map.
    const Statistics& statistics() const { return whole().map.statistics; }
    /// All that there is: the samples of a bounded frame, else the nodes of 128³ voxels that hold leaves, and
    /// the tiles. Empty where there is nothing.
    const openvdb::CoordBBox& box() const;
    /// Axes (0 x, 1 y, 2 z), the one that runs fastest in the file first: boxes that are cut along the last
    /// cost least to read.
    const std::array<int, 3>& order() const;
    /// Bytes that are held between reads.
    std::uint64_t memory() const;
    /// InvalidInput where a VDB grid has active voxels outside the leaves that touch box(), as the band of a
    /// level set may: operators on the whole grid change them too, those on blocks cannot. Surfaces end at
    /// the box and need not ask.
    void require_active_in_box() const;

    /// The leaves and tiles of the map that touch the box, in a grid with the metadata, the transform and the
    /// background of the whole; so are frame and statistics. What else a reader finds there is background.
    /// Tiles of a VDB file are cut at the leaves that touch the box. Memory: that of the grid, and some
    /// strips of the file.
    DensityMap read(const openvdb::CoordBBox& wanted, const Progress& progress = {}) const;

 private:
    class Source;
    class MrcSource;
    template <class Leaves>
    class VdbSource;

    std::string name_;
    std::unique_ptr<Source> source_;
};

}  // namespace vdbgeo
