// A grid that knows how to write itself.
#pragma once

namespace vdbgeo {

/// Marks grids that write_vdb writes as they are, by their own writeTopology and writeBuffers: neither copied
/// nor wrapped, whatever the options say of half floats.
struct SelfWritingGrid {
    virtual ~SelfWritingGrid() = default;
};

}  // namespace vdbgeo
