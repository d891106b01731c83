#include "vdbgeo/core/parallel.h"
#include "vdbgeo/tet/stuffing_fill.h"

namespace vdbgeo::stuffing {
namespace {

/// A bit for each cell of the octants of level 1 that are set.
Bits spread(std::uint64_t level_1) {
    Bits out;
    for (int x = 0; x < dim; ++x) {
        std::uint64_t word = 0;
        for (int y = 0; y < dim; ++y) {
            const std::uint64_t four = level_1 >> (16 * (x >> 1) + 4 * (y >> 1)) & 0xF;
            const std::uint64_t two = (four | four << 2) & 0x33, one = (two | two << 1) & 0x55;
            word |= (one | one << 1) << 8 * y;
        }
        out[static_cast<std::size_t>(x)] = word;
    }
    return out;
}

}  // namespace

Halo cells_of_level_0(const SnappedLattice& points, const Octree& octree, std::size_t b) {
    return make_halo(points.table(), b, [&](std::int32_t n) {
        Bits bits = n < 0 ? Bits{} : spread(octree.level_1(static_cast<std::size_t>(n)));
        for (std::uint64_t& word : bits) word = ~word;
        return bits;
    });
}

VertexTable::VertexTable(const SnappedLattice& points, const Octree& octree)
    : points_(points), octree_(octree), numbers_(points.table().size()) {
    // Bits are only ever set, by whichever block comes first: the same ones for any number of threads.
    Marks marks(16 * numbers_.size());
    parallel_for(numbers_.size(), 16, [&](std::size_t b) {
        mark_cells(b, marks);
        mark_leaves(b, marks);
    });
    std::vector<int> count(numbers_.size());
    parallel_for(numbers_.size(), 64, [&](std::size_t b) {
        int next = 0;
        for (std::size_t k = 0; k < 2; ++k) {
            RankedBits& used = numbers_[b].used[k];
            for (std::size_t x = 0; x < dim; ++x) used.bits[x] = marks[16 * b + 8 * k + x];
            next = used.rank_from(next);
        }
        numbers_[b].cuts = next;
        const SurfaceBlock* s = points_.surface(static_cast<std::int32_t>(b));
        count[b] = next + (s ? static_cast<int>(s->parts.size()) : 0);
    });
    for (std::size_t b = 0; b < numbers_.size(); ++b) {
        numbers_[b].first = size_;
        size_ += static_cast<std::uint64_t>(count[b]);
    }
}

/// Points inside that are corners or centres of cells of level 0, and snapped points with a neighbour inside.
void VertexTable::mark_cells(std::size_t b, Marks& marks) const {
    const Halo cells = cells_of_level_0(points_, octree_, b);
    const std::array<Halo, 2> plus{points_.plus(b, corner), points_.plus(b, centre)};
    const SurfaceBlock* s = points_.surface(static_cast<std::int32_t>(b));
    for (const Kind kind : {corner, centre})
        for (int x = 0; x < dim; ++x) {
            std::uint64_t word = 0;
            for (int y = 0; y < dim; ++y) {
                std::uint64_t fine = cells.row8(x, y);
                if (kind == corner)
                    for (int c = 1; c < 8; ++c) fine |= cells.row8(x - (c & 1), y - (c >> 1 & 1), -(c >> 2));
                std::uint64_t row = plus[static_cast<std::size_t>(kind)].row8(x, y) & fine;
                if (s) {
                    std::uint64_t near = 0;
                    for (const IncidentEdge& e : incident_edges(kind))
                        near |= plus[static_cast<std::size_t>(e.other)].row8(x + e.far[0], y + e.far[1],
                                                                             e.far[2]);
                    row |= row_of(s->zero[static_cast<std::size_t>(kind)], x, y) & near;
                }
                word |= row << 8 * y;
            }
            if (word)
                marks[16 * b + 8 * static_cast<std::size_t>(kind) + static_cast<std::size_t>(x)] |= word;
        }
}

/// Corners and centres of leaves of level 1 and above: all are corners of the lattice.
void VertexTable::mark_leaves(std::size_t b, Marks& marks) const {
    const auto mark = [&](const Coord& c) {
        const auto n = static_cast<std::size_t>(block_near(b, c));
        marks[16 * n + static_cast<std::size_t>(c[0] & 7)].fetch_or(
            std::uint64_t{1} << bit_of(c[1] & 7, c[2] & 7), std::memory_order_relaxed);
    };
    octree_.for_each_leaf(b, [&](const Octant& leaf) {
        const Coord origin = leaf.origin();
        const int side = 1 << leaf.level;
        for (int k = 0; k < 8; ++k)
            mark(origin.offsetBy(k & 1 ? side : 0, k & 2 ? side : 0, k & 4 ? side : 0));
        mark(origin.offsetBy(side / 2));
    });
}

std::int32_t VertexTable::block_near(std::size_t b, const Coord& cell) const {
    const Coord& at = points_.table()[b].at;
    const int x = cell[0] - 8 * at[0], y = cell[1] - 8 * at[1], z = cell[2] - 8 * at[2];
    if (std::min({x, y, z}) >= -8 && std::max({x, y, z}) < 16) return points_.table().near(b, x, y, z);
    return points_.table().find(Coord(cell[0] >> 3, cell[1] >> 3, cell[2] >> 3));
}

bool VertexTable::has_corner(std::size_t near_block, const Coord& c) const {
    const std::int32_t b = block_near(near_block, c);
    return b >= 0 &&
           test(numbers_[static_cast<std::size_t>(b)].used[corner].bits, c[0] & 7, c[1] & 7, c[2] & 7);
}

VertexId VertexTable::corner_at(std::size_t near_block, const Coord& c) const {
    const Numbers& n = numbers_[static_cast<std::size_t>(block_near(near_block, c))];
    return static_cast<VertexId>(
        n.first + static_cast<std::uint64_t>(n.used[corner].rank(c[0] & 7, c[1] & 7, c[2] & 7)));
}

VertexId VertexTable::at(std::size_t b, Kind kind, int x, int y, int z) const {
    const Numbers& n = numbers_[static_cast<std::size_t>(points_.table().near(b, x, y, z))];
    return static_cast<VertexId>(
        n.first +
        static_cast<std::uint64_t>(n.used[static_cast<std::size_t>(kind)].rank(x & 7, y & 7, z & 7)));
}

bool VertexTable::used(std::size_t b, Kind kind, int x, int y, int z) const {
    const std::int32_t n = points_.table().near(b, x, y, z);
    return n >= 0 && test(numbers_[static_cast<std::size_t>(n)].used[static_cast<std::size_t>(kind)].bits,
                          x & 7, y & 7, z & 7);
}

VertexId VertexTable::cut_at(std::size_t b, int edge_class, int x, int y, int z) const {
    const std::int32_t block = points_.table().near(b, x, y, z);
    const Numbers& n = numbers_[static_cast<std::size_t>(block)];
    const int rank =
        points_.surface(block)->cut[static_cast<std::size_t>(edge_class)].rank(x & 7, y & 7, z & 7);
    return static_cast<VertexId>(n.first + static_cast<std::uint64_t>(n.cuts + rank));
}

void VertexTable::place(const Lattice& lattice, std::size_t b, Array<Vec3d>& out) const {
    const Numbers& numbers = numbers_[b];
    const Coord& at = points_.table()[b].at;
    const SurfaceBlock* s = points_.surface(static_cast<std::int32_t>(b));
    std::size_t next = numbers.first, snap = 0;
    const auto point = [&](Kind kind, int x, int y, int z) {
        const double half = kind == centre ? 0.5 : 0;
        return Vec3d(8.0 * at[0] + x + half, 8.0 * at[1] + y + half, 8.0 * at[2] + z + half);
    };
    for (const Kind kind : {corner, centre})
        for_each_bit(numbers.used[static_cast<std::size_t>(kind)].bits, [&](int x, int y, int z) {
            Vec3d p = point(kind, x, y, z);
            if (s) {
                const int slot = 512 * kind + 64 * x + 8 * y + z;
                while (snap < s->snaps.size() && s->snaps[snap].slot < slot) ++snap;
                if (snap < s->snaps.size() && s->snaps[snap].slot == slot)
                    p += s->snaps[snap].part * incident_edges(kind)[s->snaps[snap].edge].direction;
            }
            out[next++] = lattice.to_world(p);
        });
    if (!s) return;
    for (const Kind kind : {corner, centre})
        for (const IncidentEdge& e : incident_edges(kind)) {
            if (!e.first) continue;
            const RankedBits& cut = s->cut[static_cast<std::size_t>(e.edge_class)];
            auto part = static_cast<std::size_t>(cut.before[0]);
            for_each_bit(cut.bits, [&](int x, int y, int z) {
                out[next++] = lattice.to_world(point(kind, x, y, z) + s->parts[part++] * e.direction);
            });
        }
}

}  // namespace vdbgeo::stuffing
