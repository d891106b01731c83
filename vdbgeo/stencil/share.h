// A member's share of a grid that a team works on.
#pragma once

#include <openvdb/openvdb.h>

#include <vector>

#include "vdbgeo/core/team.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

/// The leaves of a grid are shared out along y and z: each member has a box of them, and all along x. Its
/// grid holds the leaves of its own box, and of the others' those that reach into `halo` voxels around it:
/// the ghosts, which the members keep up to date for each other.
struct Share {
    Team* team = nullptr;
    /// By rank. In voxels, ends included, at multiples of 8 along y and of the size of a BlockLayout's cells
    /// along x and z; each leaf lies in one of them.
    std::vector<openvdb::CoordBBox> boxes;
    int halo = 0;  ///< voxels, a multiple of 8

    const openvdb::CoordBBox& own() const { return boxes[static_cast<std::size_t>(team->rank())]; }
    /// Own box and ghosts.
    openvdb::CoordBBox with_ghosts(int rank) const {
        openvdb::CoordBBox box = boxes[static_cast<std::size_t>(rank)];
        box.expand(halo);
        return box;
    }
};

}  // namespace vdbgeo::stencil
