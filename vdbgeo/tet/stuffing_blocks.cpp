#include "vdbgeo/tet/stuffing_blocks.h"

#include <fmt/format.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/surface/crossing_blocks.h"

namespace vdbgeo::stuffing {
namespace {

constexpr int bricks = 4;  // along an edge of a block

/// Marks what lies around groups of voxel cells.
class Marker {
 public:
    explicit Marker(const Lattice& lattice) : lattice_(lattice), reach_(lattice.from_index().cwiseAbs()) {}

    /// The cells from `first` on, `size` along each axis, in index units.
    void add(const Coord& first, const Vec3i& size) {
        const Vec3d half = 0.5 * size.cast<double>();
        const Vec3d middle = lattice_.from_index() * (Vec3d(first[0], first[1], first[2]) + half);
        // A hundredth more than the one cell that an edge reaches: for rounding.
        const Vec3d extent = reach_ * half + Vec3d::Constant(1.01);
        std::array<std::int64_t, 3> low{}, high{};
        for (int a = 0; a < 3; ++a) {
            const auto i = static_cast<std::size_t>(a);
            const double most = 8.0 * (key_bias - 2);
            if (!(std::abs(middle[a]) + extent[a] < most))
                throw NumericalError(
                    fmt::format("the map is more than {} cells wide: try a larger cell", most));
            low[i] = static_cast<std::int64_t>(std::floor((middle[a] - extent[a]) / 2));
            high[i] = static_cast<std::int64_t>(std::floor((middle[a] + extent[a]) / 2));
        }
        for (std::int64_t bx = low[0] >> 2; bx <= high[0] >> 2; ++bx)
            for (std::int64_t by = low[1] >> 2; by <= high[1] >> 2; ++by)
                for (std::int64_t bz = low[2] >> 2; bz <= high[2] >> 2; ++bz)
                    add_block({static_cast<int>(bx), static_cast<int>(by), static_cast<int>(bz)}, low, high);
    }
    std::vector<MarkedBlock> take() { return std::move(found_); }

 private:
    static std::uint64_t range(std::int64_t low, std::int64_t high, int block, int step) {
        std::uint64_t bits = 0;
        const std::int64_t first = std::int64_t{block} * bricks;
        for (std::int64_t b = std::max(low, first); b <= std::min(high, first + bricks - 1); ++b)
            bits |= std::uint64_t{1} << (b - first) * step;
        return bits;
    }

    void add_block(const Coord& at, const std::array<std::int64_t, 3>& low,
                   const std::array<std::int64_t, 3>& high) {
        // Products of sums of powers of two: each pair of bits meets in a place of its own.
        const std::uint64_t mask = range(low[0], high[0], at[0], 16) * range(low[1], high[1], at[1], 4) *
                                   range(low[2], high[2], at[2], 1);
        const std::uint64_t key = key_of(at);
        for (std::size_t k = found_.size(), tried = 0; k > 0 && tried < 32; --k, ++tried)
            if (found_[k - 1].key == key) {
                found_[k - 1].bricks |= mask;
                return;
            }
        found_.push_back({key, mask});
    }

    const Lattice& lattice_;
    const Mat3d reach_;
    std::vector<MarkedBlock> found_;
};

/// Marks around the cells of one block of 8³ voxels that are set in `crossed`, in groups of 2³.
void mark_cells(Marker& marker, const Coord& origin, const Bits& crossed, const Frame& frame) {
    constexpr std::uint64_t two_rows = 0x0303;
    for (int x = 0; x < dim; x += 2) {
        const std::uint64_t pair =
            crossed[static_cast<std::size_t>(x)] | crossed[static_cast<std::size_t>(x + 1)];
        if (pair == 0) continue;
        for (int y = 0; y < dim; y += 2)
            for (int z = 0; z < dim; z += 2) {
                if ((pair >> bit_of(y, z) & two_rows) == 0) continue;
                const Coord first = origin.offsetBy(x, y, z);
                Vec3i size(2, 2, 2);
                if (frame.bounded())
                    for (int a = 0; a < 3; ++a) size[a] = std::min(2, frame.size[a] - 1 - first[a]);
                if (size.minCoeff() > 0) marker.add(first, size);
            }
    }
}

Bits crossed_cells(const CornerSigns& s) {
    Bits crossed{};
    for (int x = 0; x < dim; ++x) {
        const std::uint64_t all =
            s.here[x] & s.y[x] & s.z[x] & s.yz[x] & s.here[x + 1] & s.y[x + 1] & s.z[x + 1] & s.yz[x + 1];
        const std::uint64_t some =
            s.here[x] | s.y[x] | s.z[x] | s.yz[x] | s.here[x + 1] | s.y[x + 1] | s.z[x + 1] | s.yz[x + 1];
        crossed[static_cast<std::size_t>(x)] = some & ~all;
    }
    return crossed;
}

/// A side of the map's box, in columns of blocks.
struct Side {
    int axis, at;  // index of its samples along the axis
    int columns(const Frame& frame, int k) const { return (frame.size[(axis + k) % 3] + dim - 1) / dim; }
};

/// The cells at a side of the box whose corners on it are not all below: there the surface is the border.
void mark_side(Marker& marker, const DensityMap& map, float isovalue, const Side& side, int column) {
    const int b = (side.axis + 1) % 3, c = (side.axis + 2) % 3;
    const auto accessor = map.grid->getConstAccessor();
    for (int row = 0; row < side.columns(map.frame, 2); ++row) {
        Coord origin;
        origin[side.axis] = side.at & ~7, origin[b] = dim * column, origin[c] = dim * row;
        const auto* leaf = accessor.probeConstLeaf(origin);
        const bool constant_in = !leaf && accessor.getValue(origin) >= isovalue;
        if (!leaf && !constant_in) continue;
        Bits samples{};
        for (int i = 0; i < dim; ++i)
            for (int j = 0; j < dim; ++j) {
                Coord v = origin;
                v[side.axis] = side.at, v[b] += i, v[c] += j;
                if (v[b] >= map.frame.size[b] || v[c] >= map.frame.size[c]) continue;
                if (leaf ? leaf->getValue(v) >= isovalue : constant_in)
                    samples[static_cast<std::size_t>(v[0] & 7)] |= std::uint64_t{1}
                                                                   << bit_of(v[1] & 7, v[2] & 7);
            }
        for_each_bit(samples, [&](int x, int y, int z) {
            // The cells around the sample: from one before it to itself.
            const Coord s(origin[0] + x, origin[1] + y, origin[2] + z);
            Coord first;
            Vec3i size;
            for (int a = 0; a < 3; ++a) {
                first[a] = std::max(0, s[a] - 1);
                size[a] = std::min(s[a] + 1, map.frame.size[a] - 1) - first[a];
            }
            marker.add(first, size);
        });
    }
}

}  // namespace

std::vector<MarkedBlock> mark_blocks(const DensityMap& map, double isovalue, const Lattice& lattice,
                                     std::uint64_t max_blocks, const Progress& progress) {
    const Frame& frame = map.frame;
    if (frame.bounded() && frame.size.minCoeff() < 2) return {};  // no cells
    const CrossingBlocks crossing(map.grid->tree(), frame, static_cast<float>(isovalue),
                                  progress.part(0, 0.5));
    std::vector<Side> sides;
    if (frame.bounded())
        for (int axis = 0; axis < 3; ++axis)
            for (const int at : {0, frame.size[axis] - 1}) sides.push_back({axis, at});
    std::vector<std::pair<Side, int>> columns;
    for (const Side& side : sides)
        for (int column = 0; column < side.columns(frame, 1); ++column) columns.emplace_back(side, column);

    constexpr std::size_t grain = 16;
    const std::size_t parts = (crossing.size() + grain - 1) / grain;
    std::vector<std::vector<MarkedBlock>> found(parts + columns.size());
    parallel_for(found.size(), 1, [&](std::size_t p) {
        Marker marker(lattice);
        if (p < parts) {
            for (std::size_t b = p * grain; b < std::min(crossing.size(), (p + 1) * grain); ++b) {
                CornerSigns signs;
                crossing.load_signs(b, signs);
                mark_cells(marker, crossing.origin(b), crossed_cells(signs), frame);
            }
        } else {
            const auto& [side, column] = columns[p - parts];
            mark_side(marker, map, static_cast<float>(isovalue), side, column);
        }
        found[p] = marker.take();
    });
    progress.report(0.8);

    std::vector<MarkedBlock> all;
    for (const auto& list : found) all.insert(all.end(), list.begin(), list.end());
    tbb::parallel_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
        return a.key != b.key ? a.key < b.key : a.bricks < b.bricks;
    });
    std::size_t count = 0;
    for (const MarkedBlock& m : all) {
        if (count > 0 && all[count - 1].key == m.key)
            all[count - 1].bricks |= m.bricks;
        else
            all[count++] = m;
    }
    all.resize(count);
    if (count > max_blocks)
        throw NumericalError(fmt::format(
            "the surface runs through more than {} blocks of 8³ cells: try a larger cell", max_blocks));
    return all;
}

BlockTable::BlockTable(const std::vector<MarkedBlock>& marked, const Lattice& lattice,
                       std::uint64_t max_blocks) {
    add_node(marked, 0, marked.size(), 0, key_bits, lattice);
    fill(max_blocks);
    std::size_t slots = 16;
    while (slots < 2 * blocks_.size()) slots *= 2;
    slots_.assign(slots, -1);
    for (std::size_t b = 0; b < keys_.size(); ++b) {
        std::size_t s = (keys_[b] * 0x9E3779B97F4A7C15ull >> 20) & (slots - 1);
        while (slots_[s] >= 0) s = (s + 1) & (slots - 1);
        slots_[s] = static_cast<std::int32_t>(b);
    }
    parallel_for(blocks_.size(), 64, [&](std::size_t b) {
        Block& block = blocks_[b];
        std::size_t k = 0;
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) block.around[k++] = find(block.at.offsetBy(x, y, z));
    });
}

/// A node of 8^level blocks whose first has the key, and marked[begin, end) in it.
void BlockTable::add_node(const std::vector<MarkedBlock>& marked, std::size_t begin, std::size_t end,
                          std::uint64_t key, int level, const Lattice& lattice) {
    if (begin == end) {
        const Coord at = block_of(key);
        // All its points are on one side: any tells it.
        if (lattice.inside(Vec3d(8.0 * at[0] + 0.5, 8.0 * at[1] + 0.5, 8.0 * at[2] + 0.5)))
            runs_.push_back({key, std::uint64_t{1} << 3 * level, -1});
        return;
    }
    if (level == 0) {
        runs_.push_back({key, 1, static_cast<std::int32_t>(begin)});
        return;
    }
    const std::uint64_t step = std::uint64_t{1} << 3 * (level - 1);
    for (std::uint64_t child = 0; child < 8; ++child) {
        const std::uint64_t last = key + (child + 1) * step;
        std::size_t middle = begin;
        if (child == 7)
            middle = end;
        else
            middle = static_cast<std::size_t>(
                std::lower_bound(marked.begin() + static_cast<std::ptrdiff_t>(begin),
                                 marked.begin() + static_cast<std::ptrdiff_t>(end), last,
                                 [](const MarkedBlock& m, std::uint64_t k) { return m.key < k; }) -
                marked.begin());
        add_node(marked, begin, middle, key + child * step, level - 1, lattice);
        begin = middle;
    }
}

void BlockTable::fill(std::uint64_t max_blocks) {
    std::uint64_t count = 0;
    for (const Run& run : runs_) {
        count += run.count;
        if (count > max_blocks || count > 0x7FFFFFFF)
            throw NumericalError(
                fmt::format("the inside has more than {} blocks of 8³ cells: try a larger cell",
                            std::min<std::uint64_t>(max_blocks, 0x7FFFFFFF)));
    }
    blocks_.resize(count);
    keys_.resize(count);
    std::vector<std::uint64_t> first(runs_.size());
    std::uint64_t next = 0;
    for (std::size_t r = 0; r < runs_.size(); ++r) first[r] = next, next += runs_[r].count;
    parallel_for(runs_.size(), 16, [&](std::size_t r) {
        for (std::uint64_t k = 0; k < runs_[r].count; ++k) {
            Block& block = blocks_[first[r] + k];
            keys_[first[r] + k] = runs_[r].key + k;
            block.at = block_of(runs_[r].key + k);
            block.marked = runs_[r].marked;
        }
    });
}

std::int32_t BlockTable::find(const Coord& at) const {
    for (int a = 0; a < 3; ++a)
        if (at[a] < -key_bias || at[a] >= key_bias) return -1;
    const std::uint64_t key = key_of(at);
    for (std::size_t s = (key * 0x9E3779B97F4A7C15ull >> 20) & (slots_.size() - 1); slots_[s] >= 0;
         s = (s + 1) & (slots_.size() - 1))
        if (keys_[static_cast<std::size_t>(slots_[s])] == key) return slots_[s];
    return -1;
}

}  // namespace vdbgeo::stuffing
