#include "vdbgeo/flow/noise.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/stencil/tiles.h"
#include "vdbgeo/volume/leaf_layout.h"
#include "vdbgeo/volume/order_statistic.h"

namespace vdbgeo {
namespace {

using stencil::BlockField;
using stencil::BlockLayout;
using stencil::Tile;

/// |L u| of a tile's active voxels whose neighbours are active; returns how many there are.
std::size_t band_of(const Tile& t, float* out) {
    std::size_t n = 0;
    const std::ptrdiff_t dx = t.stride_x, dy = t.stride_y;
    for (int x = 0; x < BlockLayout::size_x; ++x)
        for (int y = 0; y < BlockLayout::size_y; ++y) {
            const float* const u = t.in[0] + t.at(x, y, 0);
            const float* const a = t.active + t.at(x, y, 0);
            for (int z = 0; z < BlockLayout::size_z; ++z) {
                const float neighbors = a[z - dx] + a[z + dx] + a[z - dy] + a[z + dy] + a[z - 1] + a[z + 1];
                const double sum = (static_cast<double>(u[z - dx]) + u[z + dx]) +
                                   (static_cast<double>(u[z - dy]) + u[z + dy]) +
                                   (static_cast<double>(u[z - 1]) + u[z + 1]);
                out[n] = static_cast<float>(std::abs(6.0 * u[z] - sum));
                n += static_cast<std::size_t>(a[z] + neighbors > 6.5f && out[n] > 0);  // all seven
            }
        }
    return n;
}

constexpr double to_deviation = 1.4826;  // of a median absolute value, for a normal distribution

double noise_of(const openvdb::FloatTree& tree) {
    constexpr double stencil_norm = 42;  // 6² + 6 · 1²
    const BlockLayout layout(tree);
    BlockField field(layout.brick_count());
    stencil::load(layout, tree, 0, field.brick(0));
    OrderStatistic median(0.5);
    while (!median.done()) {
        stencil::for_each_tile(layout, {{field.brick(0)}, {}, 1, 0}, [&](Tile& t) {
            // One place more than there are voxels: what does not count is written behind the last that does.
            std::vector<float> band(BlockLayout::size_x * BlockLayout::size_y * BlockLayout::size_z + 1);
            median.add(band.data(), band_of(t, band.data()));
        });
        median.end_pass();
    }
    return median.count() ? to_deviation * median.value() / std::sqrt(stencil_norm) : 0;
}

/// Median of value(u) over the active voxels; 0 without any.
template <class Value>
double median_of(const std::vector<const leaf::Leaf*>& leaves, const Value& value) {
    OrderStatistic median(0.5);
    while (!median.done()) {
        parallel_for(leaves.size(), 64, [&](std::size_t i) {
            float values[leaf::size];
            std::size_t n = 0;
            for (auto it = leaves[i]->cbeginValueOn(); it; ++it) values[n++] = value(*it);
            median.add(values, n);
        });
        median.end_pass();
    }
    return median.count() ? median.value() : 0;
}

double spread_of(const openvdb::FloatTree& tree) {
    std::vector<const leaf::Leaf*> leaves;
    tree.getNodes(leaves);
    const auto middle = static_cast<float>(median_of(leaves, [](float u) { return u; }));
    return to_deviation * median_of(leaves, [&](float u) { return std::abs(u - middle); });
}

/// Runs f on a tree without active tiles.
template <class F>
double on_leaves(const openvdb::FloatTree& tree, const F& f) {
    if (!tree.hasActiveTiles()) return f(tree);
    openvdb::FloatTree leaves(tree);
    leaves.voxelizeActiveTiles();
    return f(leaves);
}

}  // namespace

double estimate_noise(const openvdb::FloatGrid& grid) { return on_leaves(grid.tree(), noise_of); }

double density_spread(const openvdb::FloatGrid& grid) { return on_leaves(grid.tree(), spread_of); }

double removable_noise(const openvdb::FloatGrid& grid) {
    constexpr double correlated = 1.5, share = 0.85, most = 2.5;
    const double white = estimate_noise(grid), spread = density_spread(grid);
    return spread > correlated * white ? std::min(share * spread, most * white) : white;
}

}  // namespace vdbgeo
