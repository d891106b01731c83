#include "vdbgeo/volume/map_statistics.h"

#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

constexpr std::size_t leaves_together = 256;

/// n equal values.
Moments many(float value, std::uint64_t n) {
    Moments m;
    if (!std::isfinite(value)) {
        m.non_finite = n;
    } else if (n > 0) {
        m.count = n;
        m.mean = value;
        m.min = m.max = value;
    }
    return m;
}

/// Deviations from the first finite value: a large mean costs no accuracy.
class Sum {
 public:
    void add(float value) {
        if (!std::isfinite(value)) {
            ++m_.non_finite;
            return;
        }
        if (m_.count++ == 0) shift_ = value;
        const double d = double(value) - shift_;
        sum_ += d;
        squares_ += d * d;
        m_.min = std::min(m_.min, value);
        m_.max = std::max(m_.max, value);
    }
    Moments moments() const {
        Moments m = m_;
        if (m.count == 0) return m;
        const double n = static_cast<double>(m.count);
        m.mean = shift_ + sum_ / n;
        m.squares = std::max(0.0, squares_ - sum_ * sum_ / n);
        return m;
    }

 private:
    Moments m_;
    double shift_ = 0, sum_ = 0, squares_ = 0;
};

/// Joins `of(leaf)` over all leaves in their order in the tree.
template <class Of>
Moments over_leaves(const openvdb::FloatTree& tree, const Of& of) {
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(tree);
    return fixed_order_reduce(
        leaves.leafCount(), leaves_together, Moments(),
        [&](std::size_t begin, std::size_t end) {
            Moments m;
            for (std::size_t i = begin; i < end; ++i) m.join(of(leaves.leaf(i)));
            return m;
        },
        [](Moments& all, const Moments& part) { all.join(part); });
}

Moments moments_in_box(const openvdb::FloatTree& tree, const CoordBBox& box) {
    Moments all = over_leaves(tree, [&](const openvdb::FloatTree::LeafNodeType& leaf) {
        const CoordBBox own = leaf.getNodeBoundingBox();
        CoordBBox inside = own;
        inside.intersect(box);
        Sum sum;
        const float* values = leaf.buffer().data();
        if (inside == own) {
            for (openvdb::Index i = 0; i < leaf.SIZE; ++i) sum.add(values[i]);
        } else {
            for (auto at = inside.begin(); at != inside.end(); ++at) sum.add(values[leaf.coordToOffset(*at)]);
        }
        return sum.moments();
    });
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        CoordBBox inside;
        tile.getBoundingBox(inside);
        inside.intersect(box);
        if (!inside.empty()) all.join(many(*tile, inside.volume()));
    }
    return all;
}

}  // namespace

Statistics statistics_of(const DensityMap& map) {
    if (!map.frame.bounded()) return active_moments(*map.grid).statistics();
    const Vec3i& n = map.frame.size;
    const CoordBBox box(Coord(0, 0, 0), Coord(n.x() - 1, n.y() - 1, n.z() - 1));
    Moments all = moments_in_box(map.grid->constTree(), box);
    const std::uint64_t seen = all.count + all.non_finite, samples = box.volume();
    if (samples > seen) all.join(many(map.grid->background(), samples - seen));  // where the tree has no node
    return all.statistics();
}

Moments active_moments(const openvdb::FloatGrid& grid) {
    Moments all = over_leaves(grid.constTree(), [](const openvdb::FloatTree::LeafNodeType& leaf) {
        Sum sum;
        for (auto it = leaf.cbeginValueOn(); it; ++it) sum.add(*it);
        return sum.moments();
    });
    auto tile = grid.constTree().cbeginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) all.join(many(*tile, tile.getVoxelCount()));
    return all;
}

double rms_difference(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
    struct Total {
        double squares = 0;
        std::uint64_t count = 0;
    };
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(a.constTree());
    Total total = fixed_order_reduce(
        leaves.leafCount(), leaves_together, Total(),
        [&](std::size_t begin, std::size_t end) {
            const auto other = b.getConstUnsafeAccessor();
            Total t;
            for (std::size_t i = begin; i < end; ++i)
                for (auto it = leaves.leaf(i).cbeginValueOn(); it; ++it) {
                    const double d = double(*it) - double(other.getValue(it.getCoord()));
                    t.squares += d * d;
                    ++t.count;
                }
            return t;
        },
        [](Total& all, const Total& part) {
            all.squares += part.squares;
            all.count += part.count;
        });
    const auto other = b.getConstUnsafeAccessor();
    auto tile = a.constTree().cbeginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        CoordBBox box;
        tile.getBoundingBox(box);
        for (auto at = box.begin(); at != box.end(); ++at) {
            const double d = double(*tile) - double(other.getValue(*at));
            total.squares += d * d;
        }
        total.count += tile.getVoxelCount();
    }
    return total.count > 0 ? std::sqrt(total.squares / static_cast<double>(total.count)) : 0;
}

}  // namespace vdbgeo
