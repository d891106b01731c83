// The bricks of fields in a file: what a computation needs to go on from there.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo {

/// Writes the bricks of a member's own cells, layout after layout; as 4-byte floats of this machine's order.
class StateWriter {
 public:
    /// `fields`: values for each voxel. Errors: IoError, from here on.
    StateWriter(const std::filesystem::path& path, std::size_t fields);
    ~StateWriter();
    StateWriter(const StateWriter&) = delete;
    StateWriter& operator=(const StateWriter&) = delete;

    void add(const stencil::BlockLayout& layout, const std::vector<const float*>& fields);
    /// Everything has reached the disk once it returns. Gives the hash of the file.
    std::string finish();

 private:
    struct File;
    std::unique_ptr<File> file_;
};

/// Bricks that others wrote, into however many files.
class StateReader {
 public:
    /// InvalidInput for files that are not what StateWriter wrote; IoError. Memory: 20 bytes a brick.
    StateReader(const std::vector<std::filesystem::path>& files, std::size_t fields);
    ~StateReader();

    /// All bricks of a layout, those of cells that are not its own too. InvalidInput where one is missing.
    void read(const stencil::BlockLayout& layout, const std::vector<float*>& fields) const;

 private:
    struct Files;
    std::unique_ptr<Files> files_;
};

}  // namespace vdbgeo
