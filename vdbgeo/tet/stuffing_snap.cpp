#include "vdbgeo/tet/stuffing_snap.h"

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo::stuffing {
namespace {

constexpr std::uint64_t row_mask = 0xFF;
constexpr int block_slots = 512;

Vec3d point(const Coord& block, int x, int y, int z, Kind kind) {
    const double half = kind == centre ? 0.5 : 0;
    return {8.0 * block[0] + x + half, 8.0 * block[1] + y + half, 8.0 * block[2] + z + half};
}

int slot_of(Kind kind, int x, int y, int z) { return block_slots * kind + 64 * x + 8 * y + z; }
Kind kind_of(int slot) { return slot < block_slots ? corner : centre; }
std::array<int, 3> place_of(int slot) { return {slot >> 6 & 7, slot >> 3 & 7, slot & 7}; }

std::array<std::array<IncidentEdge, 14>, 2> make_incident_edges() {
    std::array<std::array<IncidentEdge, 14>, 2> out;
    for (const Kind kind : {corner, centre}) {
        std::size_t n = 0;
        auto& edges = out[static_cast<std::size_t>(kind)];
        for (int a = 0; a < 3; ++a)
            for (const int step : {1, -1}) {
                std::array<int, 3> far{};
                far[static_cast<std::size_t>(a)] = step;
                edges[n++] = {kind,
                              far,
                              step > 0 ? std::array<int, 3>{} : far,
                              kind == corner ? a : 3 + a,
                              step > 0,
                              step * Vec3d::Unit(a)};
            }
        for (int b = 0; b < 8; ++b) {
            const std::array<int, 3> up{b & 1, b >> 1 & 1, b >> 2};
            const Vec3d direction(up[0] - 0.5, up[1] - 0.5, up[2] - 0.5);
            if (kind == centre)
                edges[n++] = {corner, up, {}, 6 + b, true, direction};
            else
                edges[n++] = {centre,    {-up[0], -up[1], -up[2]}, {-up[0], -up[1], -up[2]}, 6 + b, false,
                              -direction};
        }
    }
    return out;
}

std::uint64_t shifted_row(const Halo& h, int x, int y, const std::array<int, 3>& by) {
    return h.row8(x + by[0], y + by[1], by[2]);
}

}  // namespace

const std::array<IncidentEdge, 14>& incident_edges(Kind kind) {
    static const auto edges = make_incident_edges();
    return edges[static_cast<std::size_t>(kind)];
}

Halo SnappedLattice::plus(std::size_t b, Kind kind) const {
    static const Bits none{}, all{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};
    return make_halo(table_, b, [&](std::int32_t n) {
        if (n < 0) return none;
        const std::int32_t m = table_[static_cast<std::size_t>(n)].marked;
        return m < 0 ? all : inside_[static_cast<std::size_t>(m)][static_cast<std::size_t>(kind)];
    });
}

Halo SnappedLattice::zero(std::size_t b, Kind kind) const {
    return make_halo(table_, b, [&](std::int32_t n) {
        const SurfaceBlock* s = surface(n);
        return s ? s->zero[static_cast<std::size_t>(kind)] : Bits{};
    });
}

Halo SnappedLattice::critical(std::size_t b, Kind kind) const {
    return make_halo(table_, b, [&](std::int32_t n) {
        const SurfaceBlock* s = surface(n);
        return s ? s->critical[static_cast<std::size_t>(kind)] : Bits{};
    });
}

SnappedLattice::SnappedLattice(const Lattice& lattice, const std::vector<MarkedBlock>& marked,
                               const BlockTable& table, const Progress& progress)
    : table_(table) {
    sample(lattice, marked);
    progress.report(0.3);
    find_surfaces();
    parallel_for(surfaces_.size(), 4, [&](std::size_t s) { find_cuts(surfaces_[s], lattice); });
    progress.report(0.8);
    snap(progress);
}

/// The sides of the marked blocks' points: all in marked bricks, else of one for the brick.
void SnappedLattice::sample(const Lattice& lattice, const std::vector<MarkedBlock>& marked) {
    inside_.resize(marked.size());
    parallel_for(marked.size(), 4, [&](std::size_t m) {
        const Coord at = block_of(marked[m].key);
        auto& inside = inside_[m];
        TrilinearField::Cursor cursor;
        for (int brick = 0; brick < 64; ++brick) {
            const int x0 = 2 * (brick >> 4), y0 = 2 * (brick >> 2 & 3), z0 = 2 * (brick & 3);
            const bool all = marked[m].bricks >> brick & 1;
            if (!all && !lattice.inside(point(at, x0, y0, z0, centre))) continue;
            for (int k = 0; k < 8; ++k) {
                const int x = x0 + (k >> 2), y = y0 + (k >> 1 & 1), z = z0 + (k & 1);
                for (const Kind kind : {corner, centre})
                    if (!all || lattice.inside(point(at, x, y, z, kind), cursor))
                        inside[static_cast<std::size_t>(kind)][static_cast<std::size_t>(x)] |=
                            std::uint64_t{1} << bit_of(y, z);
            }
        }
    });
}

/// Which points are ends of crossed edges; a block with such points becomes a surface block.
void SnappedLattice::find_surfaces() {
    constant_.assign(table_.size(), all_in);
    surface_of_.assign(table_.size(), -1);
    std::vector<std::array<Bits, 2>> critical(inside_.size());
    parallel_for(table_.size(), 16, [&](std::size_t b) {
        if (table_[b].marked < 0) return;
        const auto m = static_cast<std::size_t>(table_[b].marked);
        const std::array<Halo, 2> in{plus(b, corner), plus(b, centre)};
        std::uint64_t some = 0, every = row_mask;
        for (const Kind kind : {corner, centre}) {
            const auto k = static_cast<std::size_t>(kind);
            for (int x = 0; x < dim; ++x)
                for (int y = 0; y < dim; ++y) {
                    const std::uint64_t here = in[k].row8(x, y);
                    std::uint64_t found = 0;
                    for (const IncidentEdge& e : incident_edges(kind))
                        found |= here ^ shifted_row(in[static_cast<std::size_t>(e.other)], x, y, e.far);
                    critical[m][k][static_cast<std::size_t>(x)] |= found << 8 * y;
                    some |= here, every &= here;
                }
        }
        const bool crossed = any(critical[m][0]) || any(critical[m][1]);
        constant_[b] = crossed ? mixed : every == row_mask ? all_in : some == 0 ? all_out : mixed;
    });
    for (std::size_t b = 0; b < table_.size(); ++b) {
        if (table_[b].marked < 0) continue;
        const auto& found = critical[static_cast<std::size_t>(table_[b].marked)];
        if (!any(found[0]) && !any(found[1])) continue;
        surface_of_[b] = static_cast<std::int32_t>(surfaces_.size());
        surfaces_.emplace_back();
        surfaces_.back().block = b;
        surfaces_.back().critical = found;
    }
}

void SnappedLattice::find_cuts(SurfaceBlock& s, const Lattice& lattice) const {
    const std::array<Halo, 2> in{plus(s.block, corner), plus(s.block, centre)};
    const Coord& at = table_[s.block].at;
    for (const Kind kind : {corner, centre})
        for (const IncidentEdge& e : incident_edges(kind)) {
            if (!e.first) continue;
            RankedBits& cut = s.cut[static_cast<std::size_t>(e.edge_class)];
            for (int x = 0; x < dim; ++x)
                for (int y = 0; y < dim; ++y)
                    cut.bits[static_cast<std::size_t>(x)] |=
                        (in[static_cast<std::size_t>(kind)].row8(x, y) ^
                         shifted_row(in[static_cast<std::size_t>(e.other)], x, y, e.far))
                        << 8 * y;
        }
    int count = 0;
    for (RankedBits& cut : s.cut) count = cut.rank_from(count);
    s.parts.resize(static_cast<std::size_t>(count));
    for (const Kind kind : {corner, centre})
        for (const IncidentEdge& e : incident_edges(kind)) {
            if (!e.first) continue;
            const RankedBits& cut = s.cut[static_cast<std::size_t>(e.edge_class)];
            auto part = static_cast<std::size_t>(cut.before[0]);
            for_each_bit(cut.bits, [&](int x, int y, int z) {
                const Vec3d p = point(at, x, y, z, kind), q = p + e.direction;
                s.parts[part++] = in[static_cast<std::size_t>(kind)].at(x, y, z) ? lattice.root(p, q)
                                                                                 : 1 - lattice.root(q, p);
            });
        }
}

/// Chooses which points are snapped, so that
///   (1) no cut point that remains is too near to an end of its edge,
///   (2) a point is snapped to a cut point that was too near, on an edge whose other end is not snapped.
/// A cut point remains where neither end is snapped. Any order of snapping point by point leads to (1): that
/// is the paper's algorithm. With (2) in addition no two snapped points come
/// towards each other, which are the worst tetrahedra otherwise.
///
/// Let v → w where the cut point of edge vw is too near to v. Both hold for a kernel of this graph: v is
/// snapped if and only if some w with v → w is not. Edges cross the surface, so all arcs run between inside
/// and outside, the graph is bipartite, and a kernel exists. It is found by two rules until neither applies:
/// v with a kept w is snapped, v whose w are all snapped is kept. What they decide is the same in any order.
/// Of what is left, in circles, v has no kept w and some undecided one; so all inside points of it are
/// snapped and all outside points kept.
///
/// Last, v is snapped to the nearest of the cut points that (2) allows. Nothing depends on the order, so
/// not on the number of threads.
void SnappedLattice::snap(const Progress& progress) {
    state_.assign(surfaces_.size(), std::vector<std::uint8_t>(2 * block_slots, kept));
    std::vector<std::vector<std::uint16_t>> open(surfaces_.size());
    parallel_for(surfaces_.size(), 8, [&](std::size_t s) {
        for (const Kind kind : {corner, centre})
            for_each_bit(surfaces_[s].critical[static_cast<std::size_t>(kind)], [&](int x, int y, int z) {
                const int slot = slot_of(kind, x, y, z);
                open[s].push_back(static_cast<std::uint16_t>(slot));
            });
        for (const std::uint16_t slot : open[s]) state_[s][slot] = undecided;
    });
    // Each round reads what the rounds before have decided, and writes aside.
    std::vector<std::vector<std::uint8_t>> verdict(surfaces_.size());
    for (bool changed = true; changed;) {
        progress.report(0.85);
        parallel_for(surfaces_.size(), 8, [&](std::size_t s) {
            verdict[s].resize(open[s].size());
            for (std::size_t k = 0; k < open[s].size(); ++k)
                verdict[s][k] = judge(surfaces_[s], open[s][k], nullptr);
        });
        changed = fixed_order_reduce(
                      surfaces_.size(), 8, std::size_t{0},
                      [&](std::size_t begin, std::size_t end) {
                          std::size_t decided = 0;
                          for (std::size_t s = begin; s < end; ++s) {
                              std::size_t left = 0;
                              for (std::size_t k = 0; k < open[s].size(); ++k) {
                                  state_[s][open[s][k]] = verdict[s][k];
                                  if (verdict[s][k] == undecided) open[s][left++] = open[s][k];
                              }
                              decided += open[s].size() - left;
                              open[s].resize(left);
                          }
                          return decided;
                      },
                      [](std::size_t& sum, std::size_t part) { sum += part; }) > 0;
    }
    parallel_for(surfaces_.size(), 8, [&](std::size_t s) {
        const auto& inside = inside_[static_cast<std::size_t>(table_[surfaces_[s].block].marked)];
        for (const std::uint16_t slot : open[s]) {
            const auto [x, y, z] = place_of(slot);
            const bool in = test(inside[static_cast<std::size_t>(kind_of(slot))], x, y, z);
            state_[s][slot] = in ? snapped : kept;
        }
    });
    finish_snaps();
}

/// What the rules say of a point: undecided where neither applies. With `best`: the nearest allowed cut
/// point.
std::uint8_t SnappedLattice::judge(const SurfaceBlock& s, int slot, Snap* best) const {
    const Kind kind = kind_of(slot);
    const auto [x, y, z] = place_of(slot);
    const auto& edges = incident_edges(kind);
    double nearest = 2;
    std::uint8_t verdict = kept;
    for (std::size_t n = 0; n < edges.size(); ++n) {
        const IncidentEdge& e = edges[n];
        const int ox = x + e.owner[0], oy = y + e.owner[1], oz = z + e.owner[2];
        const SurfaceBlock* owner = &s;
        if (((ox | oy | oz) & ~7) != 0) owner = surface(table_.near(s.block, ox, oy, oz));
        if (!owner) continue;
        const RankedBits& cut = owner->cut[static_cast<std::size_t>(e.edge_class)];
        if (!test(cut.bits, ox & 7, oy & 7, oz & 7)) continue;
        double part = owner->parts[static_cast<std::size_t>(cut.rank(ox & 7, oy & 7, oz & 7))];
        if (!e.first) part = 1 - part;
        if (part >= (is_long(e.edge_class) ? alpha_long : alpha_short)) continue;
        const int fx = x + e.far[0], fy = y + e.far[1], fz = z + e.far[2];
        const std::uint8_t far = state(table_.near(s.block, fx, fy, fz), e.other, fx & 7, fy & 7, fz & 7);
        if (far == kept) {
            if (!best) return snapped;
            const double distance = part * (is_long(e.edge_class) ? 1 : std::sqrt(0.75));
            if (distance < nearest) {
                nearest = distance;
                *best = {static_cast<std::uint16_t>(slot), static_cast<std::uint8_t>(n), part};
            }
        }
        if (far == undecided) verdict = undecided;
    }
    return nearest < 2 ? snapped : verdict;
}

std::uint8_t SnappedLattice::state(std::int32_t block, Kind kind, int x, int y, int z) const {
    const std::int32_t s = block < 0 ? -1 : surface_of_[static_cast<std::size_t>(block)];
    if (s < 0) return kept;
    return state_[static_cast<std::size_t>(s)][static_cast<std::size_t>(slot_of(kind, x, y, z))];
}

/// Where the snapped points go; then the cut points on their edges are removed.
void SnappedLattice::finish_snaps() {
    parallel_for(surfaces_.size(), 8, [&](std::size_t n) {
        SurfaceBlock& s = surfaces_[n];
        for (int slot = 0; slot < 2 * block_slots; ++slot) {
            if (state_[n][static_cast<std::size_t>(slot)] != snapped) continue;
            Snap best;
            judge(s, slot, &best);
            s.snaps.push_back(best);
            const auto [x, y, z] = place_of(slot);
            s.zero[static_cast<std::size_t>(kind_of(slot))][static_cast<std::size_t>(x)] |= std::uint64_t{1}
                                                                                            << bit_of(y, z);
        }
    });
    parallel_for(surfaces_.size(), 8, [&](std::size_t n) { remove_dead_cuts(surfaces_[n]); });
    parallel_for(surfaces_.size(), 8, [&](std::size_t n) {
        auto& inside = inside_[static_cast<std::size_t>(table_[surfaces_[n].block].marked)];
        for (std::size_t k = 0; k < 2; ++k)
            for (std::size_t x = 0; x < dim; ++x) inside[k][x] &= ~surfaces_[n].zero[k][x];
    });
    state_.clear();
    state_.shrink_to_fit();
}

void SnappedLattice::remove_dead_cuts(SurfaceBlock& s) const {
    const std::array<Halo, 2> zeros{zero(s.block, corner), zero(s.block, centre)};
    std::size_t count = 0;
    for (const Kind kind : {corner, centre})
        for (const IncidentEdge& e : incident_edges(kind)) {
            if (!e.first) continue;
            RankedBits& cut = s.cut[static_cast<std::size_t>(e.edge_class)];
            auto from = static_cast<std::size_t>(cut.before[0]);
            const Halo& here = zeros[static_cast<std::size_t>(kind)];
            const Halo& there = zeros[static_cast<std::size_t>(e.other)];
            Bits alive{};
            for_each_bit(cut.bits, [&](int x, int y, int z) {
                const double part = s.parts[from++];
                if (here.at(x, y, z) || there.at(x + e.far[0], y + e.far[1], z + e.far[2])) return;
                alive[static_cast<std::size_t>(x)] |= std::uint64_t{1} << bit_of(y, z);
                s.parts[count++] = part;
            });
            cut.bits = alive;
        }
    s.parts.resize(count);
    int next = 0;
    for (RankedBits& cut : s.cut) next = cut.rank_from(next);
}

}  // namespace vdbgeo::stuffing
