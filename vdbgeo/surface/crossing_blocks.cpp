#include "vdbgeo/surface/crossing_blocks.h"

#include <emmintrin.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using leaf::LowerNode;
using openvdb::Coord;

constexpr int node_voxels = LowerNode::DIM;

Coord offset(const Coord& c, int side, int step) {
    return c.offsetBy(side & 1 ? step : 0, side & 2 ? step : 0, side & 4 ? step : 0);
}

/// Bit z: v[z] ≥ isovalue, for eight values.
unsigned sign_bits(const float* v, float isovalue) {
    const __m128 iso = _mm_set1_ps(isovalue);
    const int low = _mm_movemask_ps(_mm_cmpge_ps(_mm_loadu_ps(v), iso));
    const int high = _mm_movemask_ps(_mm_cmpge_ps(_mm_loadu_ps(v + 4), iso));
    return static_cast<unsigned>(low | high << 4);
}

/// 1: a value lies below, 2: a value lies at or above, 3: both.
std::uint8_t leaf_state(const float* v, float isovalue) {
    const __m128 iso = _mm_set1_ps(isovalue);
    __m128 all = _mm_castsi128_ps(_mm_set1_epi32(-1)), any = _mm_setzero_ps();
    for (int i = 0; i < leaf::size; i += 8) {
        const __m128 a = _mm_cmpge_ps(_mm_loadu_ps(v + i), iso),
                     b = _mm_cmpge_ps(_mm_loadu_ps(v + i + 4), iso);
        all = _mm_and_ps(all, _mm_and_ps(a, b));
        any = _mm_or_ps(any, _mm_or_ps(a, b));
    }
    const bool below = _mm_movemask_ps(all) != 0xF, above = _mm_movemask_ps(any) != 0;
    return static_cast<std::uint8_t>((below ? 1 : 0) | (above ? 2 : 0));
}

}  // namespace

CrossingBlocks::CrossingBlocks(const openvdb::FloatTree& tree, const Frame& frame, float isovalue,
                               const Progress& progress)
    : tree_(tree), frame_(frame), isovalue_(isovalue) {
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

/// A node and its lower neighbours: their last cells reach into it.
void CrossingBlocks::add_nodes(const Coord& origin) {
    if (outside_box(origin, node_voxels)) return;
    // The neighbours' indices are 32-bit numbers too.
    constexpr std::int64_t end = std::int64_t{1} << 31, room = 2 * node_voxels;
    for (int a = 0; a < 3; ++a)
        if (origin[a] < -end + room || origin[a] >= end - room)
            throw InvalidInput(
                fmt::format("a block of the grid begins at index {}, too near to 2^31", origin[a]));
    for (int side = 0; side < 8; ++side) {
        const Coord c = offset(origin, side, -node_voxels);
        if (outside_box(c, node_voxels)) continue;
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
        if (sign_state(*it) != outside && !outside_box(it.getCoord(), leaf::UpperNode::DIM))
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
    const auto* lower = tree_.probeConstNode<LowerNode>(node.origin);
    if (!lower) {
        node.state.assign(node_blocks, sign_state(tree_.getValue(node.origin)));
        return;
    }
    node.state.resize(node_blocks);
    static_assert(LowerNode::NUM_VALUES == node_blocks, "the node's table has the block order of VDB's");
    for (auto it = lower->cbeginValueAll(); it; ++it) node.state[it.pos()] = sign_state(*it);
    // Two loops: the first finds the buffers without waiting for what lies in them.
    for (auto it = lower->cbeginChildOn(); it; ++it) node.samples[it.pos()] = it->buffer().data();
    for (std::size_t i = 0; i < node_blocks; ++i) {
        constexpr std::size_t ahead = 2;
        if (i + ahead < node_blocks && node.samples[i + ahead])
            for (int k = 0; k < leaf::size; k += 16) _mm_prefetch(node.samples[i + ahead] + k, _MM_HINT_T0);
        if (node.samples[i]) node.state[i] = leaf_state(node.samples[i], isovalue_);
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
                if (around == mixed && !outside(origin))
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

/// The part of the samples that comes from the block itself (side 0) or an upper neighbour.
void CrossingBlocks::load_rows(const Block& block, int side, BlockSamples& out) const {
    const Place p = step(block, side);
    const float* in =
        p.node < 0 ? nullptr
                   : nodes_[static_cast<std::size_t>(p.node)].samples[static_cast<std::size_t>(p.block)];
    const float constant = in ? 0 : tree_.getValue(offset(block.origin, side, leaf::dim));
    const int nx = side & 1 ? 1 : leaf::dim, ny = side & 2 ? 1 : leaf::dim;
    const int x0 = side & 1 ? leaf::dim : 0, y0 = side & 2 ? leaf::dim : 0;
    for (int x = 0; x < nx; ++x)
        for (int y = 0; y < ny; ++y) {
            float* row = out.values[x0 + x][y0 + y];
            std::uint16_t& bits =
                out.inside[static_cast<std::size_t>(x0 + x)][static_cast<std::size_t>(y0 + y)];
            if (side & 4) {
                const float last = in ? in[leaf::offset(x, y, 0)] : constant;
                row[leaf::dim] = last;
                bits = static_cast<std::uint16_t>(bits | (last >= isovalue_ ? 0x100 : 0));
            } else {
                if (in)
                    std::memcpy(row, in + leaf::offset(x, y, 0), leaf::dim * sizeof(float));
                else
                    std::fill_n(row, leaf::dim, constant);
                bits = static_cast<std::uint16_t>(sign_bits(row, isovalue_));
            }
        }
}

/// Sets the samples that load will want on their way from memory: they lie scattered over eight leaves.
void CrossingBlocks::prefetch(std::size_t b) const {
    for (int side = 0; side < 8; ++side) {
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
    if (b + 1 < blocks_.size()) prefetch(b + 1);
    for (int side = 0; side < 8; ++side)
        load_rows(blocks_[b], side, out);  // the z neighbours (4…7) come last
}

}  // namespace vdbgeo
