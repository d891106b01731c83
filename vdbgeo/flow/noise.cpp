#include "vdbgeo/flow/noise.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/stencil/tiles.h"
#include "vdbgeo/volume/order_statistic.h"

namespace vdbgeo {
namespace {

using stencil::BlockField;
using stencil::BlockLayout;
using stencil::Tile;

/// |6 u − Σ u| of a tile's active voxels whose neighbours are active; returns how many there are.
std::size_t band_of(const Tile& t, int spacing, float* out) {
    std::size_t n = 0;
    const std::ptrdiff_t dx = spacing * t.stride_x, dy = spacing * t.stride_y, dz = spacing;
    for (int x = t.work.min().x(); x <= t.work.max().x(); ++x)
        for (int y = t.work.min().y(); y <= t.work.max().y(); ++y) {
            const float* const u = t.in[0] + t.at(x, y, 0);
            const float* const a = t.active + t.at(x, y, 0);
            for (int z = t.work.min().z(); z <= t.work.max().z(); ++z) {
                const float neighbors = a[z - dx] + a[z + dx] + a[z - dy] + a[z + dy] + a[z - dz] + a[z + dz];
                const double sum = (static_cast<double>(u[z - dx]) + u[z + dx]) +
                                   (static_cast<double>(u[z - dy]) + u[z + dy]) +
                                   (static_cast<double>(u[z - dz]) + u[z + dz]);
                out[n] = static_cast<float>(std::abs(6.0 * u[z] - sum));
                n += static_cast<std::size_t>(a[z] + neighbors > 6.5f && out[n] > 0);  // all seven
            }
        }
    return n;
}

/// One cell of so many is looked at.
std::size_t sampled_of(std::uint64_t active_voxels) {
    constexpr std::size_t sample = 8000000;
    return std::max<std::size_t>(1, active_voxels / sample);
}

/// `active_voxels`: of the whole map, where the tree has its sample alone.
double noise_of(const openvdb::FloatTree& tree, int spacing, const stencil::Share* share,
                std::uint64_t active_voxels = 0) {
    constexpr double to_deviation = 1.4826;  // of a median absolute value, for a normal distribution
    constexpr double stencil_norm = 42;      // 6² + 6 · 1²
    constexpr std::size_t cell =
        std::size_t(1) * BlockLayout::size_x * BlockLayout::size_y * BlockLayout::size_z;
    Team* const team = share ? share->team : nullptr;
    const BlockLayout layout(tree, share ? std::optional(share->own()) : std::nullopt);
    std::vector<std::uint64_t> active{layout.active_count()};
    if (team) team->add_up(active);
    BlockField field(layout.brick_count());
    stencil::load(layout, tree, 0, field.brick(0));
    stencil::TileFields fields{{field.brick(0)}, {}, spacing, 0};
    fields.every = sampled_of(active_voxels ? active_voxels : active[0]);
    OrderStatistic median(0.5);
    while (!median.done()) {
        stencil::for_each_tile(layout, fields, [&](Tile& t) {
            // One place more than there are voxels: what does not count is written behind the last that does.
            std::vector<float> band(cell + 1);
            median.add(band.data(), band_of(t, spacing, band.data()));
        });
        median.end_pass(team);
    }
    return median.count() ? to_deviation * median.value() / std::sqrt(stencil_norm) : 0;
}

}  // namespace

double estimate_noise(const openvdb::FloatGrid& grid, int spacing, const stencil::Share* share) {
    if (spacing < 1 || spacing > 8) throw InvalidInput("the spacing of the noise estimate is 1 to 8");
    if (!grid.tree().hasActiveTiles()) return noise_of(grid.tree(), spacing, share);
    openvdb::FloatTree leaves(grid.tree());
    leaves.voxelizeActiveTiles();
    return noise_of(leaves, spacing, share);
}

namespace {

template <class Estimate>
double removable(const Estimate& estimate) {
    constexpr double flat = 1.3;
    const double near = estimate(2);
    return near > 0 && estimate(4) <= flat * near ? near : estimate(1);
}

}  // namespace

double removable_noise(const openvdb::FloatGrid& grid, const stencil::Share* share) {
    return removable([&](int spacing) { return estimate_noise(grid, spacing, share); });
}

double removable_noise_of_sample(const openvdb::FloatGrid& sample, std::uint64_t active_voxels) {
    return removable([&](int spacing) { return noise_of(sample.tree(), spacing, nullptr, active_voxels); });
}

bool in_noise_sample(const openvdb::Coord& cell, std::uint64_t active_voxels) {
    return stencil::in_sample(cell, sampled_of(active_voxels));
}

}  // namespace vdbgeo
