#include "vdbgeo/blocks/block_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using stencil::BlockLayout;

constexpr std::array<int, 3> cell_size{BlockLayout::size_x, BlockLayout::size_y, BlockLayout::size_z};

int floor_to(int v, int size) { return (v >= 0 ? v / size : -((size - 1 - v) / size)) * size; }

double volume(const CoordBBox& b) {
    return b.empty() ? 0.0
                     : double(b.max().x() - b.min().x() + 1) * (b.max().y() - b.min().y() + 1) *
                           (b.max().z() - b.min().z() + 1);
}

/// Sizes of blocks, in cells, that cut so many cells into ever more parts.
std::vector<int> sizes_along(int cells) {
    std::vector<int> out;
    for (int parts = 1; parts <= cells; ++parts) {
        const int size = (cells + parts - 1) / parts;
        if (out.empty() || out.back() != size) out.push_back(size);
    }
    return out;
}

/// Leaves in boxes of cells, by a table of sums.
class LeafCounts {
 public:
    LeafCounts(const CoordBBox& cells, const BrickIndex& index) : first_(cells.min()) {
        for (int a = 0; a < 3; ++a)
            size_[a] = (cells.max()[a] + 1 - cells.min()[a]) / cell_size[static_cast<std::size_t>(a)] + 1;
        sums_.assign(std::size_t(size_.x()) * size_.y() * size_.z(), 0);
        for (const BrickIndex::Cell& cell : index.cells()) {
            const Coord c = cell_at(cell.origin);
            at(c.x() + 1, c.y() + 1, c.z() + 1) = cell.count();
        }
        for (int x = 1; x < size_.x(); ++x)
            for (int y = 1; y < size_.y(); ++y)
                for (int z = 1; z < size_.z(); ++z)
                    at(x, y, z) += at(x - 1, y, z) + at(x, y - 1, z) + at(x, y, z - 1) - at(x - 1, y - 1, z) -
                                   at(x - 1, y, z - 1) - at(x, y - 1, z - 1) + at(x - 1, y - 1, z - 1);
    }
    std::int64_t in(const CoordBBox& cells) const {
        const Coord a = clamped(cell_at(cells.min())), b = clamped(cell_at(cells.max().offsetBy(1)));
        return get(b.x(), b.y(), b.z()) - get(a.x(), b.y(), b.z()) - get(b.x(), a.y(), b.z()) -
               get(b.x(), b.y(), a.z()) + get(a.x(), a.y(), b.z()) + get(a.x(), b.y(), a.z()) +
               get(b.x(), a.y(), a.z()) - get(a.x(), a.y(), a.z());
    }

 private:
    Coord cell_at(const Coord& voxel) const {
        Coord c;
        for (int a = 0; a < 3; ++a) {
            const int size = cell_size[static_cast<std::size_t>(a)];
            c[a] = floor_to(voxel[a] - first_[a], size) / size;
        }
        return c;
    }
    Coord clamped(Coord c) const {
        for (int a = 0; a < 3; ++a) c[a] = std::clamp(c[a], 0, size_[a] - 1);
        return c;
    }
    std::size_t place(int x, int y, int z) const {
        return (std::size_t(x) * size_.y() + std::size_t(y)) * size_.z() + std::size_t(z);
    }
    std::int64_t& at(int x, int y, int z) { return sums_[place(x, y, z)]; }
    std::int64_t get(int x, int y, int z) const { return sums_[place(x, y, z)]; }

    Coord first_, size_;
    std::vector<std::int64_t> sums_;
};

class Planner {
 public:
    Planner(const CoordBBox& box, const BlockWork& work, const BrickIndex* index)
        : box_(box), cells_(cells_of(box)), work_(work) {
        if (index) counts_.emplace(cells_, *index);
    }

    struct Candidate {
        Coord size;
        int steps;
        double cost;
    };
    /// The cheapest first.
    std::vector<Candidate> candidates() const {
        std::vector<Candidate> out;
        std::array<std::vector<int>, 3> sizes;
        for (int a = 0; a < 3; ++a)
            sizes[static_cast<std::size_t>(a)] =
                sizes_along((cells_.max()[a] + 1 - cells_.min()[a]) / cell_size[static_cast<std::size_t>(a)]);
        for (const int steps : step_counts())
            for (const int x : sizes[0])
                for (const int y : sizes[1])
                    for (const int z : sizes[2]) {
                        const Coord size(x * cell_size[0], y * cell_size[1], z * cell_size[2]);
                        out.push_back({size, steps, cost(size, steps)});
                    }
        std::stable_sort(out.begin(), out.end(),
                         [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
        return out;
    }
    /// What the largest block takes.
    double memory(const Candidate& c) const {
        const int halo = halo_of(c.steps);
        double most = 0;
        for (const CoordBBox& own : blocks_of(box_, c.size)) {
            CoordBBox with_ghosts = own;
            with_ghosts.expand(halo);
            with_ghosts.intersect(cells_);
            double leaves = volume(with_ghosts) / 512;
            if (counts_) leaves = std::min(leaves, double(counts_->in(cells_of(with_ghosts))));
            const double rows = with_ghosts.max().y() - with_ghosts.min().y() + 1.0;
            const double window = std::min(1.0, 2 * cell_size[1] / rows);
            most = std::max(most, leaves * (work_.bytes_a_brick + window * work_.bytes_of_window));
        }
        return most;
    }
    int halo_of(int steps) const { return block_halo(work_, steps, true, true); }

 private:
    std::vector<int> step_counts() const {
        std::vector<int> out;
        for (int parts = 1; parts <= std::max(1, work_.steps); ++parts) {
            const int sweeps = (work_.steps + work_.steps_a_sweep - 1) / work_.steps_a_sweep;
            const int n = (sweeps + parts - 1) / parts * work_.steps_a_sweep;
            if (parts > std::max(1, sweeps)) break;
            if (out.empty() || out.back() != n) out.push_back(n);
        }
        return out;
    }
    /// Nanoseconds a voxel on one machine like any other; only which is cheaper matters.
    double cost(const Coord& size, int steps) const {
        constexpr double step = 0.3, coefficients = 1.5, write = 2.5, read = 0.5;  // write, read: a byte
        const int parts = steps > 0 ? (work_.steps + steps - 1) / steps : 1;
        const auto with = [&](int halo) {
            double times = 1;
            for (int a = 0; a < 3; ++a) {
                const int all = cells_.max()[a] + 1 - cells_.min()[a], own = std::min(size[a], all);
                times *= own >= all ? 1.0 : double(std::min(own + 2 * halo, all)) / own;
            }
            return times;
        };
        const double wide = with(halo_of(steps));
        double total = read * 4 * wide + write * 4;
        if (work_.steps == 0) return total;
        total += coefficients * with(steps * work_.reach);
        for (int done = 0; done < steps; done += work_.steps_a_sweep)
            total += parts * step * work_.reach * work_.steps_a_sweep *
                     with((steps - done - work_.steps_a_sweep) * work_.reach + work_.last_reach);
        return total + (parts - 1) * (read * 12 * wide + write * 8) + (parts > 1 ? write * 4 : 0);
    }

    CoordBBox box_, cells_;
    const BlockWork& work_;
    std::optional<LeafCounts> counts_;
};

}  // namespace

CoordBBox cells_of(const CoordBBox& box) {
    CoordBBox out;
    for (int a = 0; a < 3; ++a) {
        const int size = cell_size[static_cast<std::size_t>(a)];
        out.min()[a] = floor_to(box.min()[a], size);
        out.max()[a] = floor_to(box.max()[a], size) + size - 1;
    }
    return out;
}

int block_halo(const BlockWork& work, int steps, bool first, bool last) {
    const int halo = steps * work.reach + (first ? work.first_reach : 0) + (last ? work.last_reach : 0);
    return (halo + 7) / 8 * 8;
}

std::vector<CoordBBox> blocks_of(const CoordBBox& box, const Coord& size, const BrickIndex* index) {
    const CoordBBox cells = cells_of(box);
    std::optional<LeafCounts> counts;
    if (index) counts.emplace(cells, *index);
    std::vector<CoordBBox> out;
    for (int y = cells.min().y(); y <= cells.max().y(); y += size.y())
        for (int z = cells.min().z(); z <= cells.max().z(); z += size.z())
            for (int x = cells.min().x(); x <= cells.max().x(); x += size.x()) {
                const Coord first(x, y, z);
                CoordBBox block(first, first + size.offsetBy(-1));
                block.intersect(cells);
                if (!counts || counts->in(block) > 0) out.push_back(block);
            }
    return out;
}

BlockPlan plan_blocks(const CoordBBox& box, const BlockWork& work, std::uint64_t bytes,
                      const BrickIndex* index) {
    const Planner planner(box, work, index);
    double least = -1;
    for (const Planner::Candidate& c : planner.candidates()) {
        const double memory = planner.memory(c);
        if (least < 0 || memory < least) least = memory;
        if (memory > double(bytes)) continue;
        return {c.size, c.steps, planner.halo_of(c.steps), blocks_of(box, c.size, index)};
    }
    throw NumericalError(
        fmt::format("the smallest blocks take {:.0f} MB, and {:.0f} MB are left for them; try --bin 2, "
                    "--crop, --threshold "
                    "or a larger --memory",
                    least / 1e6, double(bytes) / 1e6));
}

}  // namespace vdbgeo
