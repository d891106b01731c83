// A map in a folder of VDB files, each a part of it: how members of a team write what is too large for one.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "converters/leaf_source.h"
#include "converters/mrc.h"
#include "converters/vdb_file.h"
#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Writes the leaves and tiles of a map that lie in `own` (indices, ends included, at multiples of 8) as part
/// `number` of the folder, which must be there: part_0003.vdb. Its metadata tell the box. Errors as
/// write_vdb.
void write_map_part(const DensityMap& map, const openvdb::CoordBBox& own, int number,
                    const std::filesystem::path& folder, const VdbWriteOptions& options = {},
                    const Progress& progress = {});

/// Takes the parts out of a folder, with what is left of such as were never finished, and nothing else; the
/// folder too where nothing is left. One that is not there is left alone. IoError.
void remove_map_parts(const std::filesystem::path& folder);

/// Whether that is a folder of parts.
bool is_map_parts(const std::filesystem::path& path);

/// The parts of a folder as one map, whose voxels stay in the files.
class MapParts {
 public:
    /// Opens all parts. InvalidInput where there are none, where they differ in frame or background, or where
    /// their boxes overlap; errors as VdbSections. Memory: as VdbSections for each.
    explicit MapParts(const std::filesystem::path& folder);
    ~MapParts();
    MapParts(MapParts&&) noexcept;

    const Frame& frame() const;
    std::uint64_t active_voxels() const;
    const openvdb::CoordBBox& active_box() const;
    std::size_t parts() const;
    /// Bytes that the notes on all parts take.
    std::uint64_t memory() const;

    /// As those of VdbSections, for the whole.
    openvdb::FloatGrid::Ptr empty_grid() const;
    std::vector<openvdb::CoordBBox> pieces() const;
    void copy_to(const openvdb::CoordBBox& box, openvdb::FloatTree& to, const Progress& progress = {}) const;

    /// Writes the whole as write_mrc does, to the same bytes: eight sections in memory.
    MrcWriteReport write_mrc(const std::filesystem::path& path, const MrcWriteOptions& options = {},
                             const Progress& progress = {}) const;
    /// Writes the whole as write_vdb does, to the same bytes. `memory`: bytes of packed leaves to hold, the
    /// rest goes through a temporary file in `scratch` (StreamedGrid).
    void write_vdb(const std::filesystem::path& path, const VdbWriteOptions& options, std::uint64_t memory,
                   const std::filesystem::path& scratch, const Progress& progress = {}) const;

 private:
    struct State;
    LeafSource leaves() const;
    std::unique_ptr<State> state_;
};

}  // namespace vdbgeo
