// Sums over a grid that have the same bits whoever has which part of it.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/team.h"
#include "vdbgeo/stencil/block_layout.h"

namespace vdbgeo::stencil {

/// Joins what belongs to each cell of a grid: first the cells of one line along x, from the lowest on, then
/// the lines by y and z, over all members of a team. The cells may come in several layouts, parts of the
/// grid: of those that share a line the one of lower x first.
template <class T>
class CellTotal {
 public:
    using Join = void (*)(T& sum, const T& more);
    CellTotal(const T& start, Join join) : start_(start), join_(join) {}

    /// `of_cell`: by the layout's cells; only its own count.
    void add(const BlockLayout& layout, const std::vector<T>& of_cell) {
        for (std::size_t i = 0; i < of_cell.size(); ++i) {
            const BlockLayout::Cell& cell = layout.cells()[i];
            if (!cell.own) continue;
            const auto line = lines_.try_emplace({cell.origin.y(), cell.origin.z()}, start_).first;
            join_(line->second, of_cell[i]);
        }
    }
    /// Of all members, where there is a team; they share out whole lines.
    T total(Team* team = nullptr) const {
        struct Line {
            int y, z;
            T sum;
        };
        std::map<std::pair<int, int>, T> lines = lines_;
        if (team) {
            std::vector<Line> mine;
            for (const auto& [place, sum] : lines) mine.push_back({place.first, place.second, sum});
            for (const Line& line : gather_all(*team, mine)) lines[{line.y, line.z}] = line.sum;
        }
        T all = start_;
        for (const auto& line : lines) join_(all, line.second);
        return all;
    }

 private:
    T start_;
    Join join_;
    std::map<std::pair<int, int>, T> lines_;
};

/// part(brick, T&) adds a brick to what its cell has so far: in parallel over the own cells.
template <class T, class Part>
std::vector<T> sum_by_cell(const BlockLayout& layout, const T& start, const Part& part) {
    std::vector<T> of_cell(layout.cells().size(), start);
    parallel_for(of_cell.size(), 1, [&](std::size_t i) {
        const BlockLayout::Cell& cell = layout.cells()[i];
        if (!cell.own) return;
        T sum = start;
        for (const std::int32_t brick : cell.bricks)
            if (brick != BlockLayout::none) part(static_cast<std::size_t>(brick), sum);
        of_cell[i] = sum;
    });
    return of_cell;
}

}  // namespace vdbgeo::stencil
