#include "vdbgeo/blocks/team_marching_cubes.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/run_together.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

/// Counts this member's part. What one member refuses, all refuse.
SurfacePart count(const DensityMap& part, float isovalue, const CoordBBox& own, Team& team,
                  const Progress& progress) {
    std::optional<SurfacePart> surface;
    run_together(team, [&] { surface.emplace(part, isovalue, own, progress); });
    return std::move(*surface);
}

std::size_t owner(const std::vector<CoordBBox>& boxes, const Coord& block) {
    const auto box =
        std::find_if(boxes.begin(), boxes.end(), [&](const CoordBBox& b) { return b.isInside(block); });
    return static_cast<std::size_t>(box - boxes.begin());
}

/// The border blocks by the members that need them.
std::vector<std::vector<BorderBlock>> by_member(const std::vector<BorderBlock>& border,
                                                const std::vector<CoordBBox>& boxes) {
    std::vector<std::vector<BorderBlock>> to(boxes.size());
    for (const BorderBlock& block : border)
        for (int side = 1; block.below >> side; ++side) {
            if (!(block.below >> side & 1)) continue;
            auto& records = to.at(owner(boxes, block.block_below(side)));
            // Of several sides it may be the same member that lies below.
            if (records.empty() || records.back().origin != block.origin) records.push_back(block);
        }
    return to;
}

}  // namespace

TeamSurface team_marching_cubes(const DensityMap& part, const MarchingCubesOptions& options,
                                const stencil::Share& share, const Progress& progress) {
    options.check();
    if (share.halo < leaf::dim)
        throw InvalidInput(fmt::format(
            "marching cubes reads 8 voxels beyond a part, and the share has a halo of {}", share.halo));
    Team& team = *share.team;
    const std::vector<CoordBBox> boxes = without_border(share.boxes);
    SurfacePart surface = count(part, static_cast<float>(options.isovalue),
                                boxes[static_cast<std::size_t>(team.rank())], team, progress.part(0, 0.5));
    const SurfaceNumbers numbers(gather_all(team, surface.columns()));
    const auto to = by_member(surface.border(), boxes);
    surface.number(numbers, exchange_all(team, to));
    TeamSurface out;
    out.vertices = numbers.vertices();
    out.triangles = numbers.triangles();
    for (const auto& records : to) out.bytes_sent += records.size() * sizeof(BorderBlock);
    out.piece = surface.fill(progress.part(0.5, 1));
    return out;
}

}  // namespace vdbgeo
