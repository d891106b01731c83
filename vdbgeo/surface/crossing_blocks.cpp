#include "vdbgeo/surface/crossing_blocks.h"

#include <fmt/format.h>
#include <xmmintrin.h>

#include <algorithm>
#include <cstring>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/cell_kernels.h"

namespace vdbgeo {
namespace {

using leaf::LowerNode;
using openvdb::Coord;

constexpr int node_voxels = LowerNode::DIM;

Coord offset(const Coord& c, int side, int step) {
    return c.offsetBy(side & 1 ? step : 0, side & 2 ? step : 0, side & 4 ? step : 0);
}

constexpr LeafSigns all_below{}, all_above{{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull}};

constexpr std::uint64_t last_of_rows = 0x8080808080808080ull, first_of_rows = 0x0101010101010101ull;

/// The word of the samples one step further along y, or z, where `next` is the upper neighbour's.
std::uint64_t step_y(std::uint64_t word, std::uint64_t next) { return word >> 8 | next << 56; }
std::uint64_t step_z(std::uint64_t word, std::uint64_t next) {
    return (word >> 1 & ~last_of_rows) | (next & first_of_rows) << 7;
}

}  // namespace

CrossingBlocks::CrossingBlocks(const openvdb::FloatTree& tree, const Frame& frame, float isovalue,
                               const Progress& progress, const openvdb::CoordBBox& within)
    : tree_(tree), frame_(frame), isovalue_(isovalue), within_(within) {
    collect_nodes();
    parallel_for(nodes_.size(), 1, [&](std::size_t n) { classify(nodes_[n]); });
    progress.report(0.5);
    std::vector<std::vector<Block>> found(nodes_.size());
    parallel_for(nodes_.size(), 1, [&](std::size_t n) { find_blocks(n, found[n]); });
    std::size_t total = 0;
    for (const auto& list : found) total += list.size();
    if (total > 0x7FFFFFFF)
        throw InvalidInput(
            fmt::format("the surface runs through {} blocks of 8³ voxels, more than 2^31", total));
    blocks_.reserve(total);
    for (const auto& list : found)
        for (const Block& block : list) {
            nodes_[static_cast<std::size_t>(block.node)].block[static_cast<std::size_t>(block.place)] =
                static_cast<std::int32_t>(blocks_.size());
            blocks_.push_back(block);
        }
    progress.report(1);
}

/// Whether a block of `dim` voxels with its first at `origin` lies outside the box.
bool CrossingBlocks::outside_box(const Coord& origin, int dim) const {
    if (!frame_.bounded()) return false;
    for (int a = 0; a < 3; ++a)
        if (origin[a] <= -dim || origin[a] >= frame_.size[a]) return true;
    return false;
}

/// Whether a node of `dim` voxels has neither blocks that are looked for nor the first layers of their upper
/// neighbours.
bool CrossingBlocks::out_of_reach(const Coord& origin, int dim) const {
    for (int a = 0; a < 3; ++a) {
        const std::int64_t first = origin[a], last = first + dim - 1;
        if (last < within_.min()[a] || first > std::int64_t{within_.max()[a]} + 1) return true;
    }
    return false;
}

/// A node and its lower neighbours: their last cells reach into it.
void CrossingBlocks::add_nodes(const Coord& origin) {
    if (outside_box(origin, node_voxels) || out_of_reach(origin, node_voxels)) return;
    // The neighbours' indices are 32-bit numbers too.
    constexpr std::int64_t end = std::int64_t{1} << 31, room = 2 * node_voxels;
    for (int a = 0; a < 3; ++a)
        if (origin[a] < -end + room || origin[a] >= end - room)
            throw InvalidInput(
                fmt::format("a block of the grid begins at index {}, too near to 2^31", origin[a]));
    for (int side = 0; side < 8; ++side) {
        const Coord c = offset(origin, side, -node_voxels);
        if (outside_box(c, node_voxels) || out_of_reach(c, node_voxels)) continue;
        node_at_.emplace(c, 0);
    }
}

void CrossingBlocks::collect_nodes() {
    const State outside = sign_state(tree_.background());
    std::vector<const LowerNode*> lower;
    tree_.getNodes(lower);
    for (const LowerNode* node : lower) add_nodes(node->origin());
    std::vector<const leaf::UpperNode*> upper;
    tree_.getNodes(upper);
    for (const auto* node : upper)
        for (auto it = node->cbeginValueAll(); it; ++it)
            if (sign_state(*it) != outside) add_nodes(it.getCoord());
    for (auto it = tree_.root().cbeginValueAll(); it; ++it)
        if (sign_state(*it) != outside && !outside_box(it.getCoord(), leaf::UpperNode::DIM) &&
            !out_of_reach(it.getCoord(), leaf::UpperNode::DIM))
            throw InvalidInput(
                "a constant block of 4096³ voxels lies across the isovalue from the background");

    std::vector<Coord> origins;
    origins.reserve(node_at_.size());
    for (const auto& entry : node_at_) origins.push_back(entry.first);
    std::sort(origins.begin(), origins.end());
    nodes_.resize(origins.size());
    for (std::size_t n = 0; n < origins.size(); ++n) {
        nodes_[n].origin = origins[n];
        node_at_[origins[n]] = static_cast<int>(n);
    }
}

void CrossingBlocks::classify(Node& node) const {
    for (int side = 0; side < 8; ++side) {
        const Coord c = offset(node.origin, side, node_voxels);
        const auto found = node_at_.find(c);
        node.upper[static_cast<std::size_t>(side)] = found == node_at_.end() ? -1 : found->second;
        if (found == node_at_.end())
            node.upper_state[static_cast<std::size_t>(side)] = sign_state(tree_.getValue(c));
    }
    node.block.assign(node_blocks, -1);
    node.samples.assign(node_blocks, nullptr);
    node.signs_at.resize(node_blocks);
    const auto* lower = node.lower = tree_.probeConstNode<LowerNode>(node.origin);
    if (!lower) {
        node.state.assign(node_blocks, sign_state(tree_.getValue(node.origin)));
        return;
    }
    node.state.resize(node_blocks);
    static_assert(LowerNode::NUM_VALUES == node_blocks, "the node's table has the block order of VDB's");
    for (auto it = lower->cbeginValueAll(); it; ++it) node.state[it.pos()] = sign_state(*it);
    const cell::Kernels& kernels = cell::kernels();
    // Two loops: the first finds the buffers without waiting for what lies in them.
    for (auto it = lower->cbeginChildOn(); it; ++it) node.samples[it.pos()] = it->buffer().data();
    for (std::size_t i = 0; i < node_blocks; ++i) {
        constexpr std::size_t ahead = 2;
        if (i + ahead < node_blocks && node.samples[i + ahead])
            for (int k = 0; k < leaf::size; k += 16) _mm_prefetch(node.samples[i + ahead] + k, _MM_HINT_T0);
        if (!node.samples[i]) continue;
        LeafSigns signs;
        kernels.sign_words(node.samples[i], isovalue_, signs.word);
        std::uint64_t any = 0, all = ~0ull;
        for (const std::uint64_t word : signs.word) any |= word, all &= word;
        node.state[i] = any == 0 ? below : ~all == 0 ? above : mixed;
        if (node.state[i] != mixed) continue;
        node.signs_at[i] = static_cast<std::int32_t>(node.signs.size());
        node.signs.push_back(signs);
    }
}

void CrossingBlocks::find_blocks(std::size_t n, std::vector<Block>& out) const {
    const Node& node = nodes_[n];
    constexpr int m = node_dim + 1;
    std::array<std::uint8_t, m * m * m> state;  // of this node's blocks and of the next layer
    const auto outside = [&](const Coord& c) { return outside_box(c, leaf::dim); };
    std::uint8_t any = 0;
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < m; ++j)
            for (int k = 0; k < m; ++k) {
                const auto side = static_cast<std::size_t>((i >> 4) | (j >> 4) << 1 | (k >> 4) << 2);
                std::uint8_t s = node.upper_state[side];
                if (node.upper[side] >= 0)
                    s = nodes_[static_cast<std::size_t>(node.upper[side])]
                            .state[static_cast<std::size_t>(place(i & 15, j & 15, k & 15))];
                if (outside(node.origin.offsetBy(8 * i, 8 * j, 8 * k))) s = 0;  // does not count
                state[static_cast<std::size_t>((i * m + j) * m + k)] = s;
                any |= s;
            }
    if (any != mixed) return;
    for (int i = 0; i < node_dim; ++i)
        for (int j = 0; j < node_dim; ++j)
            for (int k = 0; k < node_dim; ++k) {
                const std::uint8_t* s = &state[static_cast<std::size_t>((i * m + j) * m + k)];
                const int around =
                    s[0] | s[1] | s[m] | s[m + 1] | s[m * m] | s[m * m + 1] | s[m * m + m] | s[m * m + m + 1];
                const Coord origin = node.origin.offsetBy(8 * i, 8 * j, 8 * k);
                if (around == mixed && !outside(origin) && within_.isInside(origin))
                    out.push_back({origin, static_cast<std::int32_t>(n), place(i, j, k)});
            }
}

CrossingBlocks::Place CrossingBlocks::step(const Block& block, int side) const {
    const int i = (block.place >> 8) + (side & 1), j = (block.place >> 4 & 15) + (side >> 1 & 1),
              k = (block.place & 15) + (side >> 2 & 1);
    const int node_side = (i >> 4) | (j >> 4) << 1 | (k >> 4) << 2;
    return {nodes_[static_cast<std::size_t>(block.node)].upper[static_cast<std::size_t>(node_side)],
            place(i & 15, j & 15, k & 15), node_side};
}

std::int64_t CrossingBlocks::neighbour(std::size_t b, int side) const {
    const Place p = step(blocks_[b], side);
    return p.node < 0 ? -1
                      : nodes_[static_cast<std::size_t>(p.node)].block[static_cast<std::size_t>(p.block)];
}

/// The signs of the block (side 0) or of an upper neighbour.
const LeafSigns& CrossingBlocks::signs(const Block& block, int side) const {
    const Place p = step(block, side);
    std::uint8_t state = 0;
    if (p.node < 0) {
        const Node& node = nodes_[static_cast<std::size_t>(block.node)];
        state = node.upper_state[static_cast<std::size_t>(p.side)];
    } else {
        const Node& node = nodes_[static_cast<std::size_t>(p.node)];
        const auto at = static_cast<std::size_t>(p.block);
        state = node.state[at];
        if (state == mixed) return node.signs[static_cast<std::size_t>(node.signs_at[at])];
    }
    return state == above ? all_above : all_below;
}

void CrossingBlocks::load_signs(std::size_t b, CornerSigns& out) const {
    const Block& block = blocks_[b];
    const LeafSigns* of[8];
    for (int side = 0; side < 8; ++side) of[side] = &signs(block, side);
    for (int x = 0; x <= leaf::dim; ++x) {
        const LeafSigns* const* from = of + (x >> 3);
        const int i = x & 7;
        const std::uint64_t here = from[0]->word[i], y = from[2]->word[i];
        out.here[x] = here;
        out.y[x] = step_y(here, y);
        out.z[x] = step_z(here, from[4]->word[i]);
        out.yz[x] = step_y(out.z[x], step_z(y, from[6]->word[i]));
    }
}

/// The value of a block, or an upper neighbour, that is no leaf.
float CrossingBlocks::constant_value(const Block& block, int side) const {
    const Coord c = offset(block.origin, side, leaf::dim);
    const Place p = step(block, side);
    if (p.node < 0) return tree_.getValue(c);
    const LowerNode* lower = nodes_[static_cast<std::size_t>(p.node)].lower;
    return lower ? lower->getValue(c) : tree_.getValue(c);
}

/// The part of the samples that comes from the block itself (side 0) or an upper neighbour.
void CrossingBlocks::load_rows(const Block& block, int side, BlockSamples& out) const {
    const Place p = step(block, side);
    const float* in =
        p.node < 0 ? nullptr
                   : nodes_[static_cast<std::size_t>(p.node)].samples[static_cast<std::size_t>(p.block)];
    float constant[leaf::dim];
    if (!in) std::fill_n(constant, leaf::dim, constant_value(block, side));
    const int nx = side & 1 ? 1 : leaf::dim, ny = side & 2 ? 1 : leaf::dim;
    const int x0 = side & 1 ? leaf::dim : 0, y0 = side & 2 ? leaf::dim : 0;
    for (int x = 0; x < nx; ++x)
        for (int y = 0; y < ny; ++y) {
            float* row = out.values[x0 + x][y0 + y];
            const float* from = in ? in + leaf::offset(x, y, 0) : constant;
            if (side & 4)
                row[leaf::dim] = *from;
            else
                std::memcpy(row, from, leaf::dim * sizeof(float));
        }
}

/// Sets the samples that load will want on their way from memory: they lie scattered over eight leaves. Those
/// above along z are mostly the next block's own.
void CrossingBlocks::prefetch(std::size_t b) const {
    for (int side = 0; side < 4; ++side) {
        const Place p = step(blocks_[b], side);
        if (p.node < 0) continue;
        const float* in = nodes_[static_cast<std::size_t>(p.node)].samples[static_cast<std::size_t>(p.block)];
        if (!in) continue;
        const int nx = side & 1 ? 1 : leaf::dim, ny = side & 2 ? 1 : leaf::dim;
        for (int x = 0; x < nx; ++x)
            for (int y = 0; y < ny; y += 2)  // two rows a cache line
                _mm_prefetch(in + leaf::offset(x, y, 0), _MM_HINT_T0);
    }
}

void CrossingBlocks::load(std::size_t b, BlockSamples& out) const {
    constexpr std::size_t ahead = 2;
    if (b + ahead < blocks_.size()) prefetch(b + ahead);
    for (int side = 0; side < 8; ++side) load_rows(blocks_[b], side, out);
}

}  // namespace vdbgeo
