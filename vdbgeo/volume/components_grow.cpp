// Dilation of a mask by a box, block by block on rows of bits.
#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <map>
#include <set>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/components.h"
#include "vdbgeo/volume/mask_block.h"

namespace vdbgeo {
namespace {

using mask::Block;
using mask::dim;
using mask::LowerNode;
using mask::Row;
using openvdb::Coord;
using openvdb::CoordBBox;

constexpr int most = 8;               // voxels a sweep: then the halo of a block is one leaf wide
constexpr int wide = dim + 2 * most;  // rows of a block with its halo

/// Bits −64 … 191 of a row: those of the block and a word on either side.
struct LongRow {
    std::array<std::uint64_t, 4> words{};

    bool empty() const { return (words[0] | words[1] | words[2] | words[3]) == 0; }

    /// Every bit and its n neighbours (n < 64) on either side; right for the two middle words.
    Row spread(int n) const {
        LongRow up = *this, down = *this;
        for (int reach = 0; reach < n;) {
            const int step = std::min(reach + 1, n - reach);
            const LongRow u = up, d = down;
            for (std::size_t w = 0; w < 4; ++w) {
                up.words[w] |= u.words[w] << step | (w > 0 ? u.words[w - 1] >> (64 - step) : 0);
                down.words[w] |= d.words[w] >> step | (w < 3 ? d.words[w + 1] << (64 - step) : 0);
            }
            reach += step;
        }
        return {{up.words[1] | down.words[1], up.words[2] | down.words[2]}};
    }
};

/// A block with the leaves around it, then spread along z, y and x in turn.
class WideBlock {
 public:
    void clear() { std::fill(rows_.begin(), rows_.end(), LongRow{}); }

    /// Takes what lies in the block's halo from the lower node (none: a full tile) at `offset` blocks from
    /// it.
    void take(const LowerNode* node, const Coord& offset) {
        const auto range = [&](int axis) {  // leaves of the neighbour
            const int o = offset[axis];
            return std::pair(o < 0 ? mask::leaves - 1 : 0, o > 0 ? 1 : mask::leaves);
        };
        const auto [x0, x1] = range(0);
        const auto [y0, y1] = range(1);
        const auto [z0, z1] = range(2);
        for (int x = x0; x < x1; ++x)
            for (int y = y0; y < y1; ++y)
                for (int z = z0; z < z1; ++z) {
                    const auto n = static_cast<openvdb::Index>((x * mask::leaves + y) * mask::leaves + z);
                    const bool child = node && node->getChildMask().isOn(n);
                    if (node && !child && !node->getValueMask().isOn(n)) continue;
                    take_leaf(child ? node->getTable()[n].getChild() : nullptr,
                              mask::times(Coord(x, y, z), mask::leaf_dim) + mask::times(offset, dim));
                }
    }

    /// Every voxel and its n neighbours.
    void spread(int n, Block& block) {
        along_z_.resize(rows_.size());
        for (std::size_t i = 0; i < rows_.size(); ++i)
            along_z_[i] = rows_[i].empty() ? Row{} : rows_[i].spread(n);
        along_y_.assign(static_cast<std::size_t>(wide * dim), Row{});
        for (int x = most - n; x < wide - most + n; ++x)
            for (int y = 0; y < dim; ++y)
                for (int k = most - n; k <= most + n; ++k)
                    along_y_[static_cast<std::size_t>(x * dim + y)] |=
                        along_z_[static_cast<std::size_t>(x * wide + y + k)];
        block.fill(false);
        for (int x = 0; x < dim; ++x)
            for (int k = most - n; k <= most + n; ++k)
                for (int y = 0; y < dim; ++y)
                    block.row(x, y) |= along_y_[static_cast<std::size_t>((x + k) * dim + y)];
    }

 private:
    /// A leaf (none: full) at `origin` relative to the block.
    void take_leaf(const mask::Leaf* leaf, const Coord& origin) {
        const auto word = static_cast<std::size_t>((origin.z() + 64) / 64);
        const int shift = (origin.z() + 64) % 64;
        for (int x = 0; x < mask::leaf_dim; ++x) {
            const std::uint64_t bits =
                leaf ? leaf->getValueMask().getWord<std::uint64_t>(static_cast<openvdb::Index>(x))
                     : ~std::uint64_t(0);
            if (!bits) continue;
            LongRow* row =
                &rows_[static_cast<std::size_t>((origin.x() + x + most) * wide + origin.y() + most)];
            for (int y = 0; y < mask::leaf_dim; ++y) row[y].words[word] |= (bits >> 8 * y & 0xff) << shift;
        }
    }

    std::vector<LongRow> rows_ = std::vector<LongRow>(static_cast<std::size_t>(wide * wide));
    std::vector<Row> along_z_, along_y_;
};

struct Workspace {
    WideBlock wide;
    Block block;
};

/// The box lies in the block, and is relative to it.
void clip(Block& block, const CoordBBox& box) {
    const Row along = mask::row_between(box.min().z(), box.max().z());
    for (int x = 0; x < dim; ++x)
        for (int y = 0; y < dim; ++y) {
            Row& row = block.row(x, y);
            const bool in =
                x >= box.min().x() && x <= box.max().x() && y >= box.min().y() && y <= box.max().y();
            row.words[0] &= in ? along.words[0] : 0;
            row.words[1] &= in ? along.words[1] : 0;
        }
}

/// One sweep of at most `most` voxels.
void sweep(openvdb::MaskTree& tree, int voxels, const CoordBBox& box) {
    std::map<Coord, const LowerNode*> sources;
    for (const mask::Place& place : mask::places_of(tree)) sources[place.origin] = place.node;
    std::set<Coord> reached;
    const int halo = voxels > 0 ? 1 : 0;
    for (const auto& [origin, node] : sources)
        for (int x = -halo; x <= halo; ++x)
            for (int y = -halo; y <= halo; ++y)
                for (int z = -halo; z <= halo; ++z) {
                    const CoordBBox target =
                        CoordBBox::createCube(origin + mask::times(Coord(x, y, z), dim), dim);
                    if (target.hasOverlap(box)) reached.insert(target.min());
                }
    const std::vector<Coord> targets(reached.begin(), reached.end());
    std::vector<std::unique_ptr<LowerNode>> nodes(targets.size());
    tbb::enumerable_thread_specific<Workspace> workspaces;
    parallel_for(targets.size(), 1, [&](std::size_t t) {
        Workspace& w = workspaces.local();
        w.wide.clear();
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    const auto found = sources.find(targets[t] + mask::times(Coord(x, y, z), dim));
                    if (found != sources.end()) w.wide.take(found->second, Coord(x, y, z));
                }
        w.wide.spread(voxels, w.block);
        CoordBBox inside = CoordBBox::createCube(targets[t], dim);
        inside.intersect(box);
        clip(w.block, CoordBBox(inside.min() - targets[t], inside.max() - targets[t]));
        nodes[t] = std::make_unique<LowerNode>(targets[t], false);
        w.block.store(*nodes[t]);
    });
    tree.clear();
    mask::fill_tree(tree, nodes);
}

}  // namespace

void grow(openvdb::MaskTree& mask, int voxels, const CoordBBox& box) {
    if (voxels < 0) throw InvalidInput(fmt::format("a mask cannot grow by {} voxels", voxels));
    sweep(mask, std::min(voxels, most), box);
    for (int left = voxels - most; left > 0; left -= most) sweep(mask, std::min(left, most), box);
}

}  // namespace vdbgeo
