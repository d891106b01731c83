// Every sample of a map, for counting: in parallel, in any order.
#pragma once

#include <openvdb/tree/LeafManager.h>

#include <array>
#include <cstdint>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Calls few(values, count) for the samples of the leaves, from several threads at once, and many(value,
/// count) for whole tiles, from this thread and never with 0. Inside a box these are all its samples, dropped
/// ones with the value they read as; of a map without a box the active voxels. The order is not fixed: for
/// sums of integers.
template <class Few, class Many>
void for_each_sample(const DensityMap& map, const Few& few, const Many& many) {
    using openvdb::CoordBBox;
    const openvdb::FloatTree& tree = map.grid->constTree();
    const bool bounded = map.frame.bounded();
    const Vec3i last = map.frame.size - Vec3i::Ones();
    const CoordBBox box = bounded ? CoordBBox({0, 0, 0}, {last.x(), last.y(), last.z()}) : CoordBBox::inf();
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(tree);
    std::uint64_t left = bounded ? box.volume() : 0;  // what no leaf and no tile holds is background
    std::vector<std::uint32_t> counts(bounded ? leaves.leafCount() : 0);
    parallel_for(leaves.leafCount(), 64, [&](std::size_t i) {
        const auto& leaf = leaves.leaf(i);
        const CoordBBox own = leaf.getNodeBoundingBox();
        CoordBBox inside = own;
        inside.intersect(box);
        const float* const values = leaf.buffer().data();
        if (bounded) counts[i] = static_cast<std::uint32_t>(inside.volume());
        if (bounded && inside == own) return few(values, std::size_t(leaf.SIZE));
        std::array<float, openvdb::FloatTree::LeafNodeType::SIZE> chosen;
        std::size_t n = 0;
        if (bounded)
            for (auto at = inside.begin(); at != inside.end(); ++at)
                chosen[n++] = values[leaf.coordToOffset(*at)];
        else
            for (auto it = leaf.cbeginValueOn(); it; ++it) chosen[n++] = *it;
        few(chosen.data(), n);
    });
    for (const std::uint32_t n : counts) left -= n;
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        CoordBBox inside;
        tile.getBoundingBox(inside);
        inside.intersect(box);
        if (inside.empty() || (!bounded && !tile.isValueOn())) continue;
        many(*tile, inside.volume());
        if (bounded) left -= inside.volume();
    }
    if (left > 0) many(map.grid->background(), left);
}

}  // namespace vdbgeo
