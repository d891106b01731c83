#include "vdbgeo/volume/map_statistics.h"

#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>
#include <vector>

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

using Leaf = openvdb::FloatTree::LeafNodeType;

using Line = StatisticsOfParts::Line;
using TileValue = StatisticsOfParts::TileValue;

/// `of(leaf)` of the leaves that begin in `own`, joined along x.
template <class Of>
std::vector<Line> lines_of(const openvdb::FloatTree& tree, const CoordBBox& own, const Of& of) {
    std::vector<const Leaf*> leaves;
    for (auto it = tree.cbeginLeaf(); it; ++it)
        if (own.isInside(it->origin())) leaves.push_back(&*it);
    tbb::parallel_sort(leaves.begin(), leaves.end(), [](const Leaf* a, const Leaf* b) {
        const Coord p = a->origin(), q = b->origin();
        return std::make_tuple(p.y(), p.z(), p.x()) < std::make_tuple(q.y(), q.z(), q.x());
    });
    std::vector<std::size_t> begins;
    for (std::size_t i = 0; i < leaves.size(); ++i)
        if (i == 0 || leaves[i]->origin().y() != leaves[i - 1]->origin().y() ||
            leaves[i]->origin().z() != leaves[i - 1]->origin().z())
            begins.push_back(i);
    std::vector<Line> lines(begins.size());
    parallel_for(lines.size(), 1, [&](std::size_t l) {
        const std::size_t end = l + 1 < begins.size() ? begins[l + 1] : leaves.size();
        lines[l] = {leaves[begins[l]]->origin().y(), leaves[begins[l]]->origin().z(), {}};
        for (std::size_t i = begins[l]; i < end; ++i) lines[l].moments.join(of(*leaves[i]));
    });
    return lines;
}

/// Lines by y and z, then tiles by their value, the lowest first.
Moments joined(std::vector<Line> lines, std::vector<TileValue> tiles, Team* team) {
    if (team) {
        lines = gather_all(*team, lines);
        tiles = gather_all(*team, tiles);
    }
    std::sort(lines.begin(), lines.end(),
              [](const Line& a, const Line& b) { return std::tie(a.y, a.z) < std::tie(b.y, b.z); });
    Moments all;
    for (const Line& line : lines) all.join(line.moments);
    std::sort(tiles.begin(), tiles.end(), [](const TileValue& a, const TileValue& b) {
        return a.value < b.value || (std::isnan(b.value) && !std::isnan(a.value));
    });
    for (std::size_t i = 0; i < tiles.size();) {
        std::uint64_t voxels = 0;
        const float value = tiles[i].value;
        do voxels += tiles[i++].voxels;
        while (i < tiles.size() && !(tiles[i].value != value));
        all.join(many(value, voxels));
    }
    return all;
}

Moments moments_in(const Leaf& leaf, const CoordBBox& box) {
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
}

Moments of_active(const Leaf& leaf) {
    Sum sum;
    for (auto it = leaf.cbeginValueOn(); it; ++it) sum.add(*it);
    return sum.moments();
}

/// Voxels of tiles, active ones alone or all that are not background, that lie in a box.
template <class Tiles>
void add_tiles(Tiles tile, const openvdb::FloatTree& tree, bool active, const CoordBBox& box,
               std::vector<TileValue>& out) {
    tile.setMaxDepth(Tiles::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        CoordBBox inside;
        tile.getBoundingBox(inside);
        inside.intersect(box);
        const float value = *tile, background = tree.background();
        // A node's tiles of the background may lie in several parts: they are told with what has no node.
        if (!inside.empty() && (active || std::memcmp(&value, &background, sizeof value) != 0))
            out.push_back({value, inside.volume()});
    }
}

CoordBBox own_of(const MapShare& share) { return share.team ? share.own : CoordBBox::inf(); }

}  // namespace

void StatisticsOfParts::add(const openvdb::FloatGrid& part, const CoordBBox& own) {
    const openvdb::FloatTree& tree = part.constTree();
    std::vector<Line> lines;
    if (frame_.bounded()) {
        CoordBBox box(Coord(0), Coord(frame_.size.x() - 1, frame_.size.y() - 1, frame_.size.z() - 1));
        lines = lines_of(tree, own, [&](const Leaf& leaf) { return moments_in(leaf, box); });
        box.intersect(own);
        add_tiles(tree.cbeginValueAll(), tree, false, box, tiles_);
    } else {
        lines = lines_of(tree, own, of_active);
        add_tiles(tree.cbeginValueOn(), tree, true, own, tiles_);
    }
    lines_.insert(lines_.end(), lines.begin(), lines.end());
}

Statistics StatisticsOfParts::statistics(float background, Team* team) const {
    Moments all = joined(lines_, tiles_, team);
    if (!frame_.bounded()) return all.statistics();
    const std::uint64_t seen = all.count + all.non_finite, samples = std::uint64_t(frame_.size.x()) *
                                                                     std::uint64_t(frame_.size.y()) *
                                                                     std::uint64_t(frame_.size.z());
    if (samples > seen) all.join(many(background, samples - seen));
    return all.statistics();
}

Statistics statistics_of(const DensityMap& map, const MapShare& share) {
    StatisticsOfParts all(map.frame);
    all.add(*map.grid, own_of(share));
    return all.statistics(map.grid->background(), share.team);
}

Moments active_moments(const openvdb::FloatGrid& grid, const MapShare& share) {
    const openvdb::FloatTree& tree = grid.constTree();
    std::vector<TileValue> tiles;
    add_tiles(tree.cbeginValueOn(), tree, true, own_of(share), tiles);
    return joined(lines_of(tree, own_of(share), of_active), tiles, share.team);
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
