// OpenVDB files: a writer that notices a full disk and compresses in parallel, a reader that looks before it
// loads.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

struct VdbWriteOptions {
    enum class Compression { none, zip, blosc };

    /// Blosc halves what is smooth at no cost in time; noise does not compress. zip is ten times slower.
    Compression compression = Compression::blosc;
    /// Store values as 16-bit floats: half the file, a relative error of 2^-11.
    bool half = false;

    void check() const {}
};

/// Writes grids to a VDB file, whole or not at all (AtomicFile). The bytes are those that OpenVDB's own
/// writer makes (but for the file's random identifier, which is derived from the grids' names and sizes here,
/// so that equal input gives equal bytes, and for a checksum of the whole file in its metadata, see
/// vdb_checksum.h); leaf buffers of float grids are compressed in parallel, a few MB in flight. Throws
/// IoError; Cancelled.
void write_vdb(const std::vector<openvdb::GridBase::ConstPtr>& grids, const std::filesystem::path& path,
               const VdbWriteOptions& options = {}, const Progress& progress = {});

/// One grid of a file, without its voxels.
struct VdbGridInfo {
    std::string name, type;
    openvdb::MetaMap metadata;
};

/// Whether a file begins with the signature of a VDB file.
bool is_vdb_file(const std::filesystem::path& path);

/// The grids of a VDB file, of any type. File formats 222 (OpenVDB 3) to 224; files that were written to a
/// pipe too, where all grids are of float, double, int32, int64 or their vectors.
///
/// The file's skeleton is walked before anything is taken from it: signature, version, every length and
/// offset against the file's size, no missing tail; bounding boxes in the metadata must be plausible. A file
/// that write_vdb wrote is compared with its checksum: it is read once as a whole. Throws InvalidInput naming
/// the fault and the grid, IoError where the file cannot be read.
std::vector<VdbGridInfo> list_vdb(const std::filesystem::path& path);

/// Reads one grid of floats: the one called `name`; unset: "density", else the first grid of floats. Checked
/// as by list_vdb; then its tree is walked, every mask and block, before OpenVDB makes nodes of it, voxels
/// are decompressed on all threads, and what was loaded is compared with the bounding box and the voxel count
/// of the metadata. A grid without an active voxel is refused unless its metadata say so. Throws InvalidInput
/// also where there is no such grid and where its transform is not linear. Memory: at most 35 times the bytes
/// of the file, however it is damaged. Notes for delayed loading are dropped from the metadata.
openvdb::FloatGrid::Ptr read_vdb(const std::filesystem::path& path,
                                 const std::optional<std::string>& name = {});

}  // namespace vdbgeo
