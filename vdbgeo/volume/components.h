// The connected parts of a mask: how large they are, which are dust, and their neighbourhood.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Deactivates every component of fewer than `min_voxels` active voxels; voxels that share a face are
/// connected. Active tiles count as the voxels that they cover. 0 and 1 leave the mask as it is. Returns how
/// many voxels went.
///
/// Blocks of 128³ voxels are searched in parallel, run by run with a union-find; only components that touch a
/// block's border are known beyond it, so that noise of billions of voxels takes, beside the mask, 8 bytes
/// for each run of voxels along a block's faces and 20 for each component there, and up to 15 MB a thread.
/// Not recursive. The result does not depend on the number of threads. Leaves and nodes that are empty then
/// are removed, full leaves become tiles. Where `progress` cancels, some of the small components are gone.
std::uint64_t remove_small_components(openvdb::MaskTree& mask, std::uint64_t min_voxels,
                                      const Progress& progress = {});

/// The number of voxels of each face-connected component, largest first; no entry for an empty mask.
std::vector<std::uint64_t> component_sizes(const openvdb::MaskTree& mask);

/// Activates all voxels within `voxels` of an active one along each axis (a box: diagonals too), and
/// deactivates what lies outside `box`. 0 only clips. Throws InvalidInput for a negative number.
///
/// Separable, on rows of bits, up to 8 voxels a sweep; in parallel. Memory: the old mask and the new.
void grow(openvdb::MaskTree& mask, int voxels, const openvdb::CoordBBox& box);

}  // namespace vdbgeo
