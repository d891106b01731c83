#include "vdbgeo/blocks/partition.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using stencil::BlockLayout;

constexpr int ghosts = 8;

/// What a part is made of: cells along x and z, and leaves along y.
constexpr int unit[3] = {BlockLayout::size_x, leaf::dim, BlockLayout::size_z};

int floor_div(int a, int b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

/// Units along an axis: the first, and how many.
std::pair<int, int> units_along(const CoordBBox& box, int axis) {
    const int first = floor_div(box.min()[axis], unit[axis]);
    return {first, floor_div(box.max()[axis], unit[axis]) - first + 1};
}

/// The first unit of a part, or the one behind the last part.
int begin_of(int part, int units, int parts) { return static_cast<int>(std::int64_t{units} * part / parts); }

/// Voxels of the box in the longest of the parts along an axis.
int longest(const CoordBBox& box, int axis, int parts) {
    const auto [first, units] = units_along(box, axis);
    int most = 0;
    for (int i = 0; i < parts; ++i) {
        const int begin = (first + begin_of(i, units, parts)) * unit[axis],
                  end = (first + begin_of(i + 1, units, parts)) * unit[axis];
        most = std::max(most, std::min(end, box.max()[axis] + 1) - std::max(begin, box.min()[axis]));
    }
    return most;
}

}  // namespace

std::vector<CoordBBox> partition(const CoordBBox& box, const std::pair<int, int>& parts) {
    const auto [x, nx] = units_along(box, 0);
    const auto [y, ny] = units_along(box, 1);
    const auto [z, nz] = units_along(box, 2);
    if (parts.first < 1 || parts.second < 1 || parts.first > ny || parts.second > nz)
        throw InvalidInput(
            fmt::format("{} x {} parts along y and z are asked for, and there are {} x {} units of {} and {} "
                        "voxels",
                        parts.first, parts.second, ny, nz, unit[1], unit[2]));
    std::vector<CoordBBox> boxes;
    for (int j = 0; j < parts.first; ++j)
        for (int k = 0; k < parts.second; ++k)
            boxes.emplace_back(Coord(x * unit[0], (y + begin_of(j, ny, parts.first)) * unit[1],
                                     (z + begin_of(k, nz, parts.second)) * unit[2]),
                               Coord((x + nx) * unit[0], (y + begin_of(j + 1, ny, parts.first)) * unit[1],
                                     (z + begin_of(k + 1, nz, parts.second)) * unit[2])
                                   .offsetBy(-1));
    return boxes;
}

std::pair<int, int> parts_for(const CoordBBox& box, int members) {
    const int ny = units_along(box, 1).second, nz = units_along(box, 2).second;
    std::optional<std::pair<std::int64_t, std::pair<int, int>>> best;
    for (int j = 1; j <= std::min(members, ny); ++j) {
        if (members % j != 0 || members / j > nz) continue;
        const int k = members / j;
        const std::int64_t work =
            std::int64_t{longest(box, 1, j) + 2 * ghosts} * (longest(box, 2, k) + 2 * ghosts);
        if (!best || work < best->first) best = {work, {j, k}};
    }
    if (!best)
        throw InvalidInput(
            fmt::format("a map of {} x {} units of {} and {} voxels along y and z cannot be "
                        "shared out to {}: take fewer",
                        ny, nz, unit[1], unit[2], members));
    return best->second;
}

std::vector<CoordBBox> without_border(std::vector<CoordBBox> boxes) {
    CoordBBox all;
    for (const CoordBBox& box : boxes) all.expand(box);
    for (CoordBBox& box : boxes)
        for (int a = 0; a < 3; ++a) {
            if (box.min()[a] == all.min()[a]) box.min()[a] = Coord::min()[a];
            if (box.max()[a] == all.max()[a]) box.max()[a] = Coord::max()[a];
        }
    return boxes;
}

}  // namespace vdbgeo
