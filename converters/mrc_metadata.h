// What a grid remembers of the map file it came from.
#pragma once

#include "converters/mrc.h"

namespace vdbgeo {

/// The metadata `mrc_*` that store_mrc_metadata writes, as far as it is there.
struct MrcRecord {
    std::optional<int> mode;
    bool unsigned_bytes = false;
    std::array<int, 3> order{0, 1, 2};
    std::optional<Vec3i> size, sampling;
    std::optional<Vec3d> voxel_size;
    std::string origin_rule;
    Vec3i nstart = Vec3i::Zero();  ///< along x, y, z
    int ispg = 0;
    std::vector<std::string> labels;
};

/// Throws InvalidInput, naming the entry, where mrc_axes or mrc_mode makes no sense.
MrcRecord recall_mrc_metadata(const openvdb::MetaMap& meta);

}  // namespace vdbgeo
