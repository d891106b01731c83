#include "vdbgeo/volume/fog.h"

#include <fmt/format.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/NodeManager.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/derived_grid.h"

namespace vdbgeo {
namespace {

using openvdb::FloatTree;

/// Turns density into fog, voxel by voxel and tile by tile.
class ToFog {
 public:
    ToFog(const FogRange& range, float background)
        : low_(range.low), scale_(1 / (range.high - range.low)), background_(background) {}

    template <class Node>
    void operator()(Node& node, std::size_t = 0) const {
        for (auto it = node.beginValueAll(); it; ++it) {
            const float v = *it;
            const bool dropped = !it.isValueOn() && v == background_;
            const bool seen = !dropped && v > low_;
            it.setValue(seen ? static_cast<float>(std::min(1.0, (v - low_) * scale_)) : 0.0f);
            it.setValueOn(seen);
        }
    }

 private:
    double low_, scale_;
    float background_;
};

}  // namespace

void FogOptions::check() const {
    const auto plain = [](const Isovalue& v) { return v.rule == Isovalue::Rule::value; };
    for (const Isovalue* level : {low ? &*low : nullptr, high ? &*high : nullptr})
        if (level && !std::isfinite(level->number))
            throw InvalidInput("a level of the fog is not a finite number");
    if (low && high && plain(*low) && plain(*high) && !(low->number < high->number))
        throw InvalidInput(fmt::format("the fog's levels have to rise: {} to {}", low->number, high->number));
}

FogRange fog_range(const Statistics& statistics, const FogOptions& options) {
    options.check();
    const auto given = [](const std::optional<Isovalue>& level) {
        return level && level->rule != Isovalue::Rule::automatic;
    };
    FogRange range;
    range.high = given(options.high) ? options.high->resolve(statistics) : statistics.max;
    range.low = given(options.low)
                    ? options.low->resolve(statistics)
                    : std::min(statistics.mean + 2 * statistics.rms, (statistics.mean + statistics.max) / 2);
    if (!std::isfinite(range.low) || !std::isfinite(range.high) || !(range.low < range.high))
        throw InvalidInput(
            fmt::format("no fog between {:.6g} and {:.6g}: the map's values lie between {:.6g} and {:.6g}",
                        range.low, range.high, statistics.min, statistics.max));
    return range;
}

openvdb::FloatGrid::Ptr fog_volume(const DensityMap& map, const FogRange& range, const Progress& progress) {
    if (map.grid->getGridClass() == openvdb::GRID_LEVEL_SET)
        throw InvalidInput("a level set has no density to make fog of");
    if (!std::isfinite(range.low) || !std::isfinite(range.high) || !(range.low < range.high))
        throw InvalidInput(fmt::format("the fog's levels have to rise: {} to {}", range.low, range.high));
    const float background = map.grid->background();
    const auto tree = std::make_shared<FloatTree>(map.grid->constTree());
    progress.report(0.3);
    const ToFog op(range, background);
    openvdb::tree::NodeManager<FloatTree> nodes(*tree);
    nodes.foreachTopDown([&](auto& node, std::size_t = 0) { op(node); });
    progress.report(0.7);
    tree->root().setBackground(0, /*updateChildNodes=*/false);
    openvdb::tools::prune(*tree);
    progress.report(1);

    const auto fog = openvdb::FloatGrid::create(tree);
    derive_from(*map.grid, map.frame, *fog, "density",
                fmt::format("fog from {} to {}", range.low, range.high));
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    set_metadata(*fog, "vdbgeo_fog_low", range.low);
    set_metadata(*fog, "vdbgeo_fog_high", range.high);
    return fog;
}

openvdb::FloatGrid::Ptr fog_volume(const DensityMap& map, const FogOptions& options,
                                   const Progress& progress) {
    return fog_volume(map, fog_range(map.statistics, options), progress);
}

}  // namespace vdbgeo
