#include "vdbgeo/tet/tet_flips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t most_around = 7;  // tetrahedra around an edge that is taken away
constexpr double least_gain = 2e-3;     // of the worth, relative

/// The other two corners of a tetrahedron with an edge, such that edge and they are in its order.
constexpr std::array<std::array<std::size_t, 2>, 6> across_edge{
    {{2, 3}, {3, 1}, {1, 2}, {0, 3}, {2, 0}, {0, 1}}};

/// What is around an edge: tetrahedra, and the polygon of their other vertices, counter-clockwise seen from
/// the edge's second end.
struct Ring {
    VertexId a = 0, b = 0;
    std::size_t count = 0;
    std::array<std::uint32_t, most_around> tets;
    std::array<VertexId, most_around> polygon;
};

/// The side of the polygon around the edge (a, b) that a tetrahedron has; nothing where it has not the edge.
std::optional<std::array<VertexId, 2>> side_of(const Tetrahedron& t, VertexId a, VertexId b) {
    for (std::size_t e = 0; e < 6; ++e) {
        const VertexId p = t[static_cast<std::size_t>(tet_edges[e][0])],
                       q = t[static_cast<std::size_t>(tet_edges[e][1])];
        const VertexId r = t[across_edge[e][0]], s = t[across_edge[e][1]];
        if (p == a && q == b) return std::array<VertexId, 2>{r, s};
        if (p == b && q == a) return std::array<VertexId, 2>{s, r};
    }
    return std::nullopt;
}

/// Nothing where the ring is open, has too many tetrahedra, or more than one region.
std::optional<Ring> ring_of(const TetStore& store, VertexId a, VertexId b) {
    Ring ring;
    ring.a = a, ring.b = b;
    std::array<std::array<VertexId, 2>, most_around> sides;
    for (const std::uint32_t t : store.star(a)) {
        const auto side = side_of(store.tet(t), a, b);
        if (!side) continue;
        if (ring.count == most_around || store.region(t) != store.region(ring.count ? ring.tets[0] : t))
            return std::nullopt;
        sides[ring.count] = *side;
        ring.tets[ring.count++] = t;
    }
    if (ring.count < 3) return std::nullopt;
    VertexId at = sides[0][0];
    for (std::size_t i = 0; i < ring.count; ++i) {
        ring.polygon[i] = at;
        std::size_t s = 0;
        while (s < ring.count && sides[s][0] != at) ++s;
        if (s == ring.count || (i > 0 && at == ring.polygon[0])) return std::nullopt;
        at = sides[s][1];
    }
    return at == ring.polygon[0] ? std::optional<Ring>(ring) : std::nullopt;
}

/// The triangulation of a ring's polygon whose worst tetrahedron is best.
class Triangulation {
 public:
    Triangulation(const TetStore& store, const Ring& ring, double floor) : store_(store), ring_(ring) {
        const std::size_t n = ring.count;
        for (std::size_t i = 0; i + 1 < n; ++i) best_[i][i + 1] = std::numeric_limits<double>::infinity();
        for (std::size_t width = 2; width < n; ++width)
            for (std::size_t i = 0; i + width < n; ++i) solve(i, i + width, floor);
    }

    /// What the worst tetrahedron is worth; less than 0 where none is above the floor.
    double worth() const { return best_[0][ring_.count - 1]; }
    void append(std::vector<Tetrahedron>& fresh) const { append(0, ring_.count - 1, fresh); }

 private:
    Tetrahedron upper(std::size_t i, std::size_t k, std::size_t j) const {
        return {ring_.polygon[i], ring_.polygon[k], ring_.polygon[j], ring_.b};
    }
    Tetrahedron lower(std::size_t i, std::size_t k, std::size_t j) const {
        return {ring_.polygon[i], ring_.polygon[j], ring_.polygon[k], ring_.a};
    }
    void solve(std::size_t i, std::size_t j, double floor) {
        best_[i][j] = -2;
        for (std::size_t k = i + 1; k < j; ++k) {
            double worth = std::min(best_[i][k], best_[k][j]);
            const double least = std::max(floor, best_[i][j]);
            if (worth > least) worth = std::min(worth, store_.worth_of(upper(i, k, j)));
            if (worth > least) worth = std::min(worth, store_.worth_of(lower(i, k, j)));
            if (worth > least) best_[i][j] = worth, middle_[i][j] = k;
        }
    }
    void append(std::size_t i, std::size_t j, std::vector<Tetrahedron>& fresh) const {
        if (j < i + 2) return;
        const std::size_t k = middle_[i][j];
        fresh.push_back(upper(i, k, j));
        fresh.push_back(lower(i, k, j));
        append(i, k, fresh);
        append(k, j, fresh);
    }

    const TetStore& store_;
    const Ring& ring_;
    std::array<std::array<double, most_around>, most_around> best_;
    std::array<std::array<std::size_t, most_around>, most_around> middle_;
};

double least_worth(const TetStore& store, const std::vector<std::uint32_t>& tets) {
    double least = std::numeric_limits<double>::infinity();
    for (const std::uint32_t t : tets) least = std::min(least, store.worth(t));
    return least;
}

/// What a flip has to be above.
double floor_of(double before) { return std::max(before * (1 + least_gain), 1e-12); }

/// In a mesh that does not overlap itself fresh tetrahedra that are not turned over are enough. This makes
/// sure for one that does: no triangle gets a third tetrahedron.
bool conforms(const TetStore& store, const TetFlip& flip) {
    for (const Tetrahedron& fresh : flip.fresh)
        for (const std::array<int, 3>& face : tet_faces) {
            VertexId v[3];
            for (std::size_t c = 0; c < 3; ++c) v[c] = fresh[static_cast<std::size_t>(face[c])];
            std::size_t with = 0;
            const auto on_face = [&](const Tetrahedron& t) {
                return std::all_of(v, v + 3,
                                   [&](VertexId w) { return std::find(t.begin(), t.end(), w) != t.end(); });
            };
            for (const std::uint32_t t : store.star(v[0]))
                if (std::find(flip.old.begin(), flip.old.end(), t) == flip.old.end())
                    with += on_face(store.tet(t));
            for (const Tetrahedron& t : flip.fresh) with += on_face(t);
            if (with > 2) return false;
        }
    return true;
}

/// The flip of a tetrahedron that gains most.
std::optional<TetFlip> best_flip(const TetStore& store, std::uint32_t tet) {
    std::optional<TetFlip> best;
    const auto keep = [&](std::optional<TetFlip>&& flip) {
        if (flip && (!best || flip->after - flip->before > best->after - best->before))
            best = std::move(flip);
    };
    for (std::size_t e = 0; e < 6; ++e) keep(edge_removal(store, tet, e));
    for (std::size_t k = 0; k < 4; ++k) keep(face_removal(store, tet, k));
    return best;
}

}  // namespace

std::optional<TetFlip> edge_removal(const TetStore& store, std::uint32_t tet, std::size_t edge) {
    const Tetrahedron& t = store.tet(tet);
    const auto ring = ring_of(store, t[static_cast<std::size_t>(tet_edges[edge][0])],
                              t[static_cast<std::size_t>(tet_edges[edge][1])]);
    if (!ring) return std::nullopt;
    TetFlip flip;
    flip.old.assign(ring->tets.begin(), ring->tets.begin() + static_cast<std::ptrdiff_t>(ring->count));
    flip.before = least_worth(store, flip.old);
    const Triangulation best(store, *ring, floor_of(flip.before));
    flip.after = best.worth();
    if (flip.after <= floor_of(flip.before)) return std::nullopt;
    best.append(flip.fresh);
    return flip;
}

std::optional<TetFlip> face_removal(const TetStore& store, std::uint32_t tet, std::size_t k) {
    const std::uint32_t other = store.across(tet, k);
    if (other == store.slot_count() || store.region(other) != store.region(tet)) return std::nullopt;
    const Tetrahedron &t = store.tet(tet), &u = store.tet(other);
    TetFlip flip;
    flip.old = {tet, other};
    flip.before = least_worth(store, flip.old);
    flip.after = std::numeric_limits<double>::infinity();
    const VertexId beyond = *std::find_if(
        u.begin(), u.end(), [&](VertexId v) { return std::find(t.begin(), t.end(), v) == t.end(); });
    for (std::size_t c = 0; c < 3; ++c) {
        const VertexId p = t[static_cast<std::size_t>(tet_faces[k][c])],
                       q = t[static_cast<std::size_t>(tet_faces[k][(c + 1) % 3])];
        flip.fresh.push_back({t[k], beyond, p, q});
        flip.after = std::min(flip.after, store.worth_of(flip.fresh.back()));
        if (flip.after <= floor_of(flip.before)) return std::nullopt;
    }
    return flip;
}

std::uint64_t flip_tets(TetStore& store, const std::vector<std::uint32_t>& bad,
                        std::vector<std::uint32_t>& tried, std::uint32_t& epoch) {
    std::vector<std::uint32_t> active;
    tried.resize(store.slot_count(), 0);
    for (const std::uint32_t t : bad)
        if (store.changed_around(t) >= tried[t]) active.push_back(t);
    ++epoch;
    std::vector<std::optional<TetFlip>> found(active.size());
    parallel_for(active.size(), 64, [&](std::size_t i) { found[i] = best_flip(store, active[i]); });
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < active.size(); ++i) {
        tried[active[i]] = found[i] ? 0 : epoch;
        if (found[i]) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return found[a]->after - found[a]->before > found[b]->after - found[b]->before;
    });
    std::vector<bool> touched(store.slot_count(), false);
    std::uint64_t flips = 0;
    for (const std::size_t i : order) {
        const TetFlip& flip = *found[i];
        if (std::any_of(flip.old.begin(), flip.old.end(), [&](std::uint32_t t) { return touched[t]; }))
            continue;
        if (!conforms(store, flip)) continue;
        for (const std::uint32_t t : flip.old) touched[t] = true;
        store.replace(flip.old, flip.fresh, epoch);
        ++flips;
    }
    return flips;
}

}  // namespace vdbgeo
