// The header of a map file that is to be written.
#pragma once

#include "converters/mrc_header.h"
#include "converters/mrc_metadata.h"

namespace vdbgeo {

/// The header for frame.size samples from index `first` of a map that lies as `frame` says, with the axes,
/// the sampling, the space group and the labels that `record` remembers; without statistics. Throws
/// InvalidInput where an MRC header cannot say how the map lies.
MrcHeader new_mrc_header(const Frame& frame, const Vec3i& first, const MrcRecord& record, int mode,
                         bool unsigned_bytes);

/// Puts the label in that tells how stored numbers become densities, "vdbgeo: density = 0.5 * stored + 1", in
/// the place of an older one of its kind.
void state_scaling(MrcHeader& header, const MrcScaling& scaling);

}  // namespace vdbgeo
