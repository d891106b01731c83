#include "vdbgeo/blocks/partition.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <tuple>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using stencil::BlockLayout;

constexpr int cell_size[3] = {BlockLayout::size_x, BlockLayout::size_y, BlockLayout::size_z};

int floor_div(int a, int b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

/// Cells along an axis: the first, and how many.
std::pair<int, int> cells_along(const CoordBBox& box, int axis) {
    const int first = floor_div(box.min()[axis], cell_size[axis]);
    return {first, floor_div(box.max()[axis], cell_size[axis]) - first + 1};
}

/// Cells in the longest of n ranges.
int longest(int cells, int n) { return (cells + n - 1) / n; }

}  // namespace

std::vector<CoordBBox> partition(const CoordBBox& box, const std::pair<int, int>& parts) {
    const auto [x, nx] = cells_along(box, 0);
    const auto [y, ny] = cells_along(box, 1);
    const auto [z, nz] = cells_along(box, 2);
    if (parts.first < 1 || parts.second < 1 || parts.first > ny || parts.second > nz)
        throw InvalidInput(fmt::format(
            "{} x {} parts along y and z are asked for, and there are {} x {} blocks of 32 and 128 voxels",
            parts.first, parts.second, ny, nz));
    std::vector<CoordBBox> boxes;
    const auto cut = [](int first, int cells, int parts_in_all, int part) {
        return first + static_cast<int>(std::int64_t{cells} * part / parts_in_all);
    };
    for (int j = 0; j < parts.first; ++j)
        for (int k = 0; k < parts.second; ++k)
            boxes.emplace_back(Coord(x * cell_size[0], cut(y, ny, parts.first, j) * cell_size[1],
                                     cut(z, nz, parts.second, k) * cell_size[2]),
                               Coord((x + nx) * cell_size[0], cut(y, ny, parts.first, j + 1) * cell_size[1],
                                     cut(z, nz, parts.second, k + 1) * cell_size[2])
                                   .offsetBy(-1));
    return boxes;
}

std::pair<int, int> parts_for(const CoordBBox& box, int members) {
    const int nx = cells_along(box, 0).second, ny = cells_along(box, 1).second,
              nz = cells_along(box, 2).second;
    using Cost = std::tuple<int, std::int64_t>;
    std::optional<std::pair<Cost, std::pair<int, int>>> best;
    for (int j = 1; j <= std::min(members, ny); ++j) {
        if (members % j != 0 || members / j > nz) continue;
        const int k = members / j;
        const std::int64_t border =
            std::int64_t{nx} * cell_size[0] *
            (std::int64_t{j - 1} * nz * cell_size[2] + std::int64_t{k - 1} * ny * cell_size[1]);
        const Cost cost{longest(ny, j) * longest(nz, k), border};
        if (!best || cost < best->first) best = {cost, {j, k}};
    }
    if (!best)
        throw InvalidInput(
            fmt::format("a map of {} x {} blocks of 32 and 128 voxels along y and z cannot be shared out to "
                        "{}: take fewer",
                        ny, nz, members));
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
