// What the level set {f = 0} of a trilinear interpolant looks like, found by cutting boxes in half until
// nothing is left to decide. It knows no case table, no asymptotic decider and no formula for a saddle.
//
// A function that is linear along each axis has no local extremum inside a box, an edge or a face (unless it
// is constant there). So, for values in general position:
//  - on an edge the level set is at most one point, there where the ends' signs differ;
//  - in a face it is arcs that end on the face's edges: half as many as edges are crossed, however they run;
//  - in a box no piece of it is closed; each piece has a boundary, which runs through edges of the box. So
//  the
//    pieces are known when it is known which crossed edges are connected.
// A face without alternating corners has one arc at most, and nothing to decide. A box is simple if no face
// alternates and f is strictly monotone along one axis (its derivative is multilinear: the signs at the
// corners tell). Then the level set is a graph over the points of the box's shadow where f changes sign from
// floor to lid, {f_floor ≤ 0 ≤ f_lid} say. What is missing from the shadow is where f_floor > 0 or f_lid < 0,
// and each piece of that reaches the shadow's rim (no extremum inside), so the graph has no holes: it is one
// disc for every closed curve that the arcs form on the box's faces.
// A box that is not simple is halved. Both halves meet in a rectangle, whose arcs both share: crossings on
// its four edges connect the pieces, and χ(box) = χ(half) + χ(half) − number of arcs in the rectangle. How
// either half is cut further does not matter to the other, so the cuts need not fit together.
// Cutting ends unless the level lies (nearly) at a saddle of f, or a cut touches the level set; those samples
// are reported as undecided.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo::test {

/// Disjoint sets of the indices of an array; the root of a set is its smallest member.
template <class Storage>
class DisjointSets {
 public:
    explicit DisjointSets(Storage storage) : parent_(std::move(storage)) {
        std::iota(parent_.begin(), parent_.end(), 0u);
    }
    std::size_t root(std::size_t i) {
        while (parent_[i] != i) {
            parent_[i] = parent_[parent_[i]];
            i = parent_[i];
        }
        return i;
    }
    void join(std::size_t a, std::size_t b) {
        a = root(a);
        b = root(b);
        parent_[std::max(a, b)] = static_cast<std::uint32_t>(std::min(a, b));
    }

 private:
    Storage parent_;
};
template <std::size_t n>
using SmallSets = DisjointSets<std::array<std::uint32_t, n>>;

/// A box of N = 2 or 3 dimensions by the function's values at its corners: corner c lies at place
/// (c >> a & 1) along axis a. Edge a·2^(N−1) + b runs along axis a; the bits of b are its places along the
/// other axes.
template <int N>
struct Box {
    static constexpr int corners = 1 << N, half = corners / 2, edges = N * half;
    std::array<double, corners> value{};

    /// b with a bit put in at position a.
    static constexpr int insert(int b, int a, int bit) {
        return (b >> a) << (a + 1) | bit << a | (b & ((1 << a) - 1));
    }
    static constexpr int remove(int c, int a) { return (c >> (a + 1)) << a | (c & ((1 << a) - 1)); }

    double at(int c) const { return value[static_cast<std::size_t>(c)]; }
    bool inside(int c) const { return at(c) >= 0; }
    bool crossed(int e) const {
        const int a = e / half, c = insert(e % half, a, 0);
        return inside(c) != inside(c | 1 << a);
    }
    /// The side across axis a, as a box of one dimension less.
    Box<N - 1> side(int a, int place) const {
        Box<N - 1> s;
        for (int k = 0; k < half; ++k) s.value[static_cast<std::size_t>(k)] = at(insert(k, a, place));
        return s;
    }
    /// This box's number of edge `e` of that side.
    static constexpr int edge_of_side(int a, int place, int e) {
        const int along = e / (half / 2), c = insert(insert(e % (half / 2), along, 0), a, place);
        const int axis = along + (along >= a);
        return axis * half + remove(c, axis);
    }
};

/// The pieces of the level set in a box: for each edge the smallest edge that it is connected to, −1 where it
/// is not crossed.
template <int N>
struct Pieces {
    std::array<int, Box<N>::edges> piece;
    int euler = 0;

    Pieces() { piece.fill(-1); }
    int count() const {
        int n = 0;
        for (int e = 0; e < Box<N>::edges; ++e) n += piece[static_cast<std::size_t>(e)] == e;
        return n;
    }
};

namespace oracle {

/// Arcs in a face whose edges are crossed, by the number of sign changes around it.
inline int arcs(const Box<2>& face) {
    return (face.crossed(0) + face.crossed(1) + face.crossed(2) + face.crossed(3)) / 2;
}
inline int level_set_euler(const Box<1>& edge) { return edge.inside(0) != edge.inside(1); }
inline int level_set_euler(const Box<2>& face) { return arcs(face); }

inline bool simple(const Box<2>& face) { return arcs(face) < 2; }

inline bool simple(const Box<3>& box) {
    for (int a = 0; a < 3; ++a)
        if (arcs(box.side(a, 0)) == 2 || arcs(box.side(a, 1)) == 2) return false;
    for (int a = 0; a < 3; ++a) {
        int up = 0, down = 0;
        for (int b = 0; b < 4; ++b) {
            const double low = box.at(box.insert(b, a, 0)), high = box.at(box.insert(b, a, 1));
            up += high > low;
            down += high < low;
        }
        if (up == 4 || down == 4) return true;
    }
    return false;
}

template <int N, class Sets>
void set_pieces(const Box<N>& box, Sets& sets, Pieces<N>& out) {
    for (int e = 0; e < Box<N>::edges; ++e)
        if (box.crossed(e))
            out.piece[static_cast<std::size_t>(e)] = static_cast<int>(sets.root(static_cast<std::size_t>(e)));
}

/// The one arc of a simple face.
inline Pieces<2> of_simple(const Box<2>& face) {
    Pieces<2> out;
    SmallSets<4> sets({});
    std::size_t first = 4;
    for (std::size_t e = 0; e < 4; ++e)
        if (face.crossed(static_cast<int>(e))) {
            if (first < 4) sets.join(first, e);
            first = e;
        }
    set_pieces(face, sets, out);
    out.euler = out.count();
    return out;
}

/// Joins the edges of a box that an arc in one of its faces connects. `arcs_of` gives a face's pieces.
template <class Arcs>
void join_along_faces(const Box<3>& box, SmallSets<12>& sets, const Arcs& arcs_of) {
    for (int a = 0; a < 3; ++a)
        for (int place = 0; place < 2; ++place) {
            const Pieces<2> face = arcs_of(box.side(a, place));
            for (int e = 0; e < 4; ++e)
                if (const int to = face.piece[static_cast<std::size_t>(e)]; to >= 0)
                    sets.join(static_cast<std::size_t>(Box<3>::edge_of_side(a, place, e)),
                              static_cast<std::size_t>(Box<3>::edge_of_side(a, place, to)));
        }
}

/// The discs of a simple box.
inline Pieces<3> of_simple(const Box<3>& box) {
    Pieces<3> out;
    SmallSets<12> sets({});
    join_along_faces(box, sets, [](const Box<2>& face) { return of_simple(face); });
    set_pieces(box, sets, out);
    out.euler = out.count();
    return out;
}

}  // namespace oracle

/// The level set in a box; nothing where it is not decided after `cuts` halvings along each axis.
template <int N>
std::optional<Pieces<N>> level_set(const Box<N>& box, int cuts = 20, int axis = 0) {
    using B = Box<N>;
    int inside = 0;
    for (int c = 0; c < B::corners; ++c) inside += box.inside(c);
    if (inside == 0 || inside == B::corners) return Pieces<N>();  // extremes lie at corners
    if (oracle::simple(box)) return oracle::of_simple(box);
    if (cuts == 0) return std::nullopt;

    B low = box, high = box;
    for (int b = 0; b < B::half; ++b) {
        const int c = B::insert(b, axis, 0), d = B::insert(b, axis, 1);
        const double middle = 0.5 * (box.at(c) + box.at(d));
        if (middle == 0) return std::nullopt;  // the cut touches the level set
        low.value[static_cast<std::size_t>(d)] = high.value[static_cast<std::size_t>(c)] = middle;
    }
    const int next = (axis + 1) % N;
    const auto below = level_set(low, cuts - (next == 0), next);
    const auto above = below ? level_set(high, cuts - (next == 0), next) : std::nullopt;
    if (!above) return std::nullopt;

    // Edges of the lower half, then of the upper half.
    SmallSets<2 * B::edges> sets({});
    const auto in_low = [](int e) { return static_cast<std::size_t>(e); };
    const auto in_high = [](int e) { return static_cast<std::size_t>(B::edges + e); };
    for (int e = 0; e < B::edges; ++e) {
        if (const int to = below->piece[in_low(e)]; to >= 0) sets.join(in_low(e), in_low(to));
        if (const int to = above->piece[in_low(e)]; to >= 0) sets.join(in_high(e), in_high(to));
    }
    for (int e = 0; e < Box<N - 1>::edges; ++e)
        sets.join(in_low(B::edge_of_side(axis, 1, e)), in_high(B::edge_of_side(axis, 0, e)));

    // Only edges of the whole box are of interest; each piece has one.
    Pieces<N> out;
    out.euler = below->euler + above->euler - oracle::level_set_euler(low.side(axis, 1));
    std::array<int, 2 * B::edges> first;
    first.fill(-1);
    for (int e = 0; e < B::edges; ++e) {
        if (!box.crossed(e)) continue;
        const int a = e / B::half, lower = B::insert(e % B::half, a, 0);
        const bool in_upper_half = a == axis ? high.crossed(e) : (lower >> axis & 1) == 1;
        int& root = first[sets.root(in_upper_half ? in_high(e) : in_low(e))];
        if (root < 0) root = e;
        out.piece[in_low(e)] = root;
    }
    for (int e = 0; e < B::edges; ++e)
        if ((low.crossed(e) && first[sets.root(in_low(e))] < 0) ||
            (high.crossed(e) && first[sets.root(in_high(e))] < 0))
            throw std::logic_error("oracle: a closed piece inside a box");
    return out;
}

/// The level set in one cell, and the closed curves that it cuts out of the cell's faces.
struct CellSurface {
    Pieces<3> surface;
    std::array<int, 12> loop;  // per edge as in Pieces
};

inline std::optional<CellSurface> cell_surface(const Box<3>& box) {
    const auto surface = level_set(box);
    if (!surface) return std::nullopt;
    bool decided = true;
    SmallSets<12> sets({});
    oracle::join_along_faces(box, sets, [&](const Box<2>& face) {
        const auto arcs = level_set(face);
        decided = decided && arcs;
        return arcs ? *arcs : Pieces<2>();
    });
    if (!decided) return std::nullopt;
    Pieces<3> loops;
    oracle::set_pieces(box, sets, loops);
    // No piece has a handle: each is a sphere with holes, χ = 2 − number of its loops. This ties what was
    // found in three dimensions to what was found in two.
    if (surface->euler != 2 * surface->count() - loops.count())
        throw std::logic_error("oracle: Euler characteristic and loops do not agree");
    return CellSurface{*surface, loops.piece};
}

/// The level set of the interpolant of a whole box of samples.
struct FieldSurface {
    std::int64_t euler = 0, components = 0, undecided_cells = 0;
};

/// χ is additive over the open cells, faces and edges: a cell's surface without its boundary (closed curves,
/// χ = 0) counts what the whole counts, an open arc −1, a crossing 1.
inline FieldSurface field_surface(const Vec3i& size, const std::vector<float>& values, float isovalue = 0) {
    const auto index = [&](const Vec3i& p) {
        return static_cast<std::size_t>(p.x()) +
               static_cast<std::size_t>(size.x()) *
                   (static_cast<std::size_t>(p.y()) +
                    static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(p.z()));
    };
    const auto corner = [](int c) { return Vec3i(c & 1, c >> 1 & 1, c >> 2 & 1); };
    const auto inside = [&](const Vec3i& p) { return values[index(p)] >= isovalue; };
    const auto grid_edge = [&](const Vec3i& p, int a) { return 3 * index(p) + static_cast<std::size_t>(a); };
    FieldSurface out;
    DisjointSets<std::vector<std::uint32_t>> sets(std::vector<std::uint32_t>(3 * values.size()));
    std::vector<std::size_t> crossings;
    Vec3i p;
    for (p.z() = 0; p.z() < size.z(); ++p.z())
        for (p.y() = 0; p.y() < size.y(); ++p.y())
            for (p.x() = 0; p.x() < size.x(); ++p.x()) {
                for (int a = 0; a < 3; ++a) {
                    const Vec3i step = Vec3i::Unit(a), other = Vec3i::Unit((a + 1) % 3);
                    if (p[a] + 1 == size[a]) continue;
                    if (inside(p) != inside(p + step)) {
                        ++out.euler;
                        crossings.push_back(grid_edge(p, a));
                    }
                    if (p[(a + 1) % 3] + 1 == size[(a + 1) % 3]) continue;
                    const bool around[4] = {inside(p), inside(p + step), inside(p + step + other),
                                            inside(p + other)};
                    int changes = 0;
                    for (int k = 0; k < 4; ++k) changes += around[k] != around[(k + 1) % 4];
                    out.euler -= changes / 2;
                }
                if (((p + Vec3i::Ones()).array() >= size.array()).any()) continue;
                Box<3> box;
                for (int c = 0; c < 8; ++c)
                    box.value[static_cast<std::size_t>(c)] =
                        static_cast<double>(values[index(p + corner(c))]) - static_cast<double>(isovalue);
                const auto surface = level_set(box);
                if (!surface) {
                    ++out.undecided_cells;
                    continue;
                }
                out.euler += surface->euler;
                const auto edge_at = [&](int e) {
                    return grid_edge(p + corner(Box<3>::insert(e % 4, e / 4, 0)), e / 4);
                };
                for (int e = 0; e < 12; ++e)
                    if (const int to = surface->piece[static_cast<std::size_t>(e)]; to >= 0)
                        sets.join(edge_at(e), edge_at(to));
            }
    for (const std::size_t e : crossings) out.components += sets.root(e) == e;
    return out;
}

}  // namespace vdbgeo::test
