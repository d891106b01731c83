#include "vdbgeo/tet/stuffing_octree.h"

#include "vdbgeo/core/parallel.h"

namespace vdbgeo::stuffing {

Octree::Octree(const SnappedLattice& points, int coarsening, const Progress& progress)
    : table_(points.table()), coarsening_(coarsening), nodes_(table_.size()) {
    if (coarsening >= 1)
        parallel_for(nodes_.size(), 16, [&](std::size_t b) { nodes_[b].level_1 = merge_cells(points, b); });
    // Each level looks at the one below alone, and writes its own numbers.
    if (coarsening >= 2)
        parallel_for(nodes_.size(), 16, [&](std::size_t b) {
            if (nodes_[b].level_1 == 0) return;
            if (all_around(b, [](const Node& n) { return n.level_1 == ~std::uint64_t{0}; })) {
                nodes_[b].level_2 = 0xFF;
                return;
            }
            const Coord& at = table_[b].at;
            for (int k = 0; k < 8; ++k)
                if (surrounded(
                        {2, Coord(2 * at[0] + (k >> 2), 2 * at[1] + (k >> 1 & 1), 2 * at[2] + (k & 1))}))
                    nodes_[b].level_2 = static_cast<std::uint8_t>(nodes_[b].level_2 | 1 << k);
        });
    for (int level = 3; level <= coarsening; ++level) {
        progress.report(static_cast<double>(level) / (coarsening + 1));
        merge_blocks(level);
    }
}

/// Octants of 2³ cells which are all inside and away from points with crossed edges.
std::uint64_t Octree::merge_cells(const SnappedLattice& points, std::size_t b) const {
    const std::int32_t me = static_cast<std::int32_t>(b);
    if (!points.full(me) && !points.surface(me)) return 0;
    bool near_surface = false;
    for (const std::int32_t n : table_[b].around) near_surface |= points.surface(n) != nullptr;
    if (!near_surface) return ~std::uint64_t{0};
    const Halo inside = points.plus(b, centre), corners = points.critical(b, corner),
               centres = points.critical(b, centre);
    std::uint64_t merged = 0;
    for (int x = 0; x < dim; x += 2)
        for (int y = 0; y < dim; y += 2) {
            std::uint64_t row = 0xFF;
            for (int k = 0; k < 4; ++k) {
                const int i = x + (k & 1), j = y + (k >> 1);
                std::uint64_t held = centres.row8(i, j) | centres.row8(i, j, 1) | centres.row8(i, j, -1) |
                                     centres.row8(i + 1, j) | centres.row8(i - 1, j) |
                                     centres.row8(i, j + 1) | centres.row8(i, j - 1);
                for (int c = 0; c < 8; ++c) held |= corners.row8(i + (c & 1), j + (c >> 1 & 1), c >> 2);
                row &= inside.row8(i, j) & ~held;
            }
            for (int z = 0; z < dim; z += 2)
                if ((row >> z & 3) == 3) merged |= std::uint64_t{1} << (8 * x + 2 * y + z / 2);
        }
    return merged;
}

/// Whether the children, and all octants of their size that share a face or an edge with this one, are whole.
bool Octree::surrounded(const Octant& octant) const {
    const auto child = [&](int x, int y, int z) {
        return Octant{octant.level - 1,
                      Coord(2 * octant.at[0] + x, 2 * octant.at[1] + y, 2 * octant.at[2] + z)};
    };
    for (int k = 0; k < 8; ++k)
        if (!whole(child(k & 1, k >> 1 & 1, k >> 2))) return false;
    for (int x = -1; x <= 2; ++x)
        for (int y = -1; y <= 2; ++y)
            for (int z = -1; z <= 2; ++z) {
                const int outer = (x == -1 || x == 2) + (y == -1 || y == 2) + (z == -1 || z == 2);
                if ((outer == 1 || outer == 2) && !whole(child(x, y, z))) return false;
            }
    return true;
}

void Octree::merge_blocks(int level) {
    const int shift = level - 3, rest = (1 << shift) - 1;
    std::vector<std::uint8_t> merged(nodes_.size(), 0);
    parallel_for(nodes_.size(), 16, [&](std::size_t b) {
        const Coord& at = table_[b].at;
        if (((at[0] | at[1] | at[2]) & rest) != 0 ||
            (level == 3 ? nodes_[b].level_2 != 0xFF : nodes_[b].top < level - 1))
            return;
        merged[b] = (level == 3 && all_around(b, [](const Node& n) { return n.level_2 == 0xFF; })) ||
                    surrounded({level, Coord(at[0] >> shift, at[1] >> shift, at[2] >> shift)});
    });
    parallel_for(nodes_.size(), 64, [&](std::size_t b) {
        if (!merged[b]) return;
        const Coord& at = table_[b].at;
        for (int x = 0; x <= rest; ++x)
            for (int y = 0; y <= rest; ++y)
                for (int z = 0; z <= rest; ++z)
                    nodes_[static_cast<std::size_t>(table_.find(at.offsetBy(x, y, z)))].top =
                        static_cast<std::uint8_t>(level);
    });
}

bool Octree::whole(const Octant& octant) const {
    if (octant.level > coarsening_) return false;
    if (octant.level >= 3) {
        const int shift = octant.level - 3;
        const std::int32_t b = table_.find(
            Coord(octant.at[0] * (1 << shift), octant.at[1] * (1 << shift), octant.at[2] * (1 << shift)));
        return b >= 0 && nodes_[static_cast<std::size_t>(b)].top >= octant.level;
    }
    if (octant.level == 0) return true;
    const int down = 3 - octant.level, low = (1 << down) - 1;
    const std::int32_t b =
        table_.find(Coord(octant.at[0] >> down, octant.at[1] >> down, octant.at[2] >> down));
    if (b < 0) return false;
    const int x = octant.at[0] & low, y = octant.at[1] & low, z = octant.at[2] & low;
    const Node& node = nodes_[static_cast<std::size_t>(b)];
    return octant.level == 1 ? node.level_1 >> (16 * x + 4 * y + z) & 1
                             : node.level_2 >> (4 * x + 2 * y + z) & 1;
}

}  // namespace vdbgeo::stuffing
