// For grids that know how they are written.
#pragma once

#include "converters/vdb_file.h"

namespace vdbgeo {

/// A grid with this base is handed to OpenVDB's archive as it is: its own writeTopology and writeBuffers make
/// the bytes.
struct SelfWritingGrid {
    virtual ~SelfWritingGrid() = default;
};

/// The flags of OpenVDB's file format that `options` stand for.
std::uint32_t compression_flags(const VdbWriteOptions& options);

}  // namespace vdbgeo
