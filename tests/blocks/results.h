// What came out of blocks and of teams, to be compared.
#pragma once

#include <cstring>

#include "vdbgeo/blocks/blocked_map.h"
#include "vdbgeo/flow/diffusion_fields.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo::test {

/// Active voxels of `a` in a box of which `b` has other bits.
inline std::uint64_t different(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b,
                               const openvdb::CoordBBox& where = openvdb::CoordBBox::inf()) {
    std::uint64_t n = 0;
    for (auto it = a.cbeginValueOn(); it; ++it) {
        const float value = b.tree().getValue(it.getCoord());
        n += where.isInside(it.getCoord()) && std::memcmp(&*it, &value, sizeof value) != 0;
    }
    return n;
}

/// Puts the active values of a part that lie in a box into the whole.
inline void put_in(const openvdb::FloatGrid& part, const openvdb::CoordBBox& box, openvdb::FloatGrid& whole) {
    for (auto it = part.cbeginValueOn(); it; ++it)
        if (box.isInside(it.getCoord())) whole.tree().setValue(it.getCoord(), *it);
}

/// What was made of a map, slab by slab; the report learns what was removed.
inline openvdb::FloatGrid::Ptr stored(const BlockedResult& made, const openvdb::FloatGrid& input,
                                      HyperdiffusionReport& report) {
    using openvdb::Coord;
    const openvdb::FloatGrid::Ptr all = input.deepCopy();
    const openvdb::CoordBBox box = input.evalActiveVoxelBoundingBox();
    ExactSum squares;
    for (int z = box.min().z() & ~7; z <= box.max().z(); z += 8) {
        const openvdb::CoordBBox slab(Coord(-1000, -1000, z), Coord(1000, 1000, z + 7));
        const openvdb::FloatGrid::Ptr part = part_of(input, slab);
        squares.add(made.store(slab, part->tree()));
        put_in(*part, slab, *all);
    }
    report.removed = root_mean_square(squares, report.active_voxels);
    return all;
}

}  // namespace vdbgeo::test
