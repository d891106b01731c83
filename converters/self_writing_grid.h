// A grid that knows how to write itself.
#pragma once

#include "converters/vdb_file.h"

namespace vdbgeo {

/// Marks grids that write_vdb writes as they are, by their own writeTopology and writeBuffers: neither copied
/// nor wrapped, whatever the options say of half floats.
struct SelfWritingGrid {
    virtual ~SelfWritingGrid() = default;
    /// Where to tell how far the writing is.
    virtual void report_to(const Progress&) const {}
};

/// The flags of OpenVDB's file format that `options` stand for.
std::uint32_t compression_flags(const VdbWriteOptions& options);

}  // namespace vdbgeo
