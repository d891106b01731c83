// Sums over a grid that have the same bits whoever has which part of it.
#pragma once

#include <algorithm>
#include <tuple>
#include <vector>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/team.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

/// Joins what belongs to each cell: first the cells of one line along x, from the lowest on, then the lines
/// by y and z, over all members of the team. `of_cell`: by the layout's cells; ghosts do not count.
template <class T, class Join>
T join_cells(const BlockLayout& layout, Team* team, const std::vector<T>& of_cell, const T& start,
             const Join& join) {
    struct Line {
        int y, z;
        T sum;
    };
    std::vector<Line> lines;
    for (std::size_t i = 0; i < of_cell.size(); ++i) {
        const BlockLayout::Cell& cell = layout.cells()[i];
        if (!cell.own) continue;
        const int y = cell.origin.y(), z = cell.origin.z();
        if (lines.empty() || lines.back().y != y || lines.back().z != z) lines.push_back({y, z, start});
        join(lines.back().sum, of_cell[i]);
    }
    if (team) {
        lines = gather_all(*team, lines);
        std::sort(lines.begin(), lines.end(),
                  [](const Line& a, const Line& b) { return std::tie(a.y, a.z) < std::tie(b.y, b.z); });
    }
    T total = start;
    for (const Line& line : lines) join(total, line.sum);
    return total;
}

/// The same with part(brick, T&), which adds a brick to what its cell has so far: in parallel over the cells.
template <class T, class Part, class Join>
T sum_bricks(const BlockLayout& layout, Team* team, const T& start, const Part& part, const Join& join) {
    std::vector<T> of_cell(layout.cells().size(), start);
    parallel_for(of_cell.size(), 1, [&](std::size_t i) {
        const BlockLayout::Cell& cell = layout.cells()[i];
        if (!cell.own) return;
        T sum = start;
        for (const std::int32_t brick : cell.bricks)
            if (brick != BlockLayout::none) part(static_cast<std::size_t>(brick), sum);
        of_cell[i] = sum;
    });
    return join_cells(layout, team, of_cell, start, join);
}

}  // namespace vdbgeo::stencil
