#include "vdbgeo/surface/cell_topology.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <optional>
#include <vector>

namespace vdbgeo::cell {
namespace {

using Loop = std::vector<int>;  // edges whose crossings follow one another along a closed contour

int edge_between(int a, int b) {
    for (int e = 0; e < edges; ++e)
        if (lower_corner(e) == std::min(a, b) && upper_corner(e) == std::max(a, b)) return e;
    std::abort();
}

/// Corners of a face in the order that is counter-clockwise seen from outside the cell.
constexpr std::array<int, 4> make_face_corners(int face) {
    const int axis = face / 2, side = face % 2, u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
    const int base = side << axis;
    if (side == 1) return {base, base + u, base + u + v, base + v};
    return {base, base + v, base + u + v, base + u};
}
constexpr std::array<std::array<int, 4>, faces> face_corners{make_face_corners(0), make_face_corners(1),
                                                             make_face_corners(2), make_face_corners(3),
                                                             make_face_corners(4), make_face_corners(5)};

bool inside(int sign_case, int corner) { return sign_case >> corner & 1; }

bool is_ambiguous(int sign_case, int face) {
    const auto& q = face_corners[face];
    return inside(sign_case, q[0]) == inside(sign_case, q[2]) &&
           inside(sign_case, q[1]) == inside(sign_case, q[3]) &&
           inside(sign_case, q[0]) != inside(sign_case, q[1]);
}

bool on_face(int edge, int face) {
    const int axis = face / 2, side = face % 2;
    return (lower_corner(edge) >> axis & 1) == side && (upper_corner(edge) >> axis & 1) == side;
}

bool share_a_face(int a, int b) {
    for (int f = 0; f < faces; ++f)
        if (on_face(a, f) && on_face(b, f)) return true;
    return false;
}

/// The contours of all faces, chained into loops. Bit f of `joined`: on the ambiguous face f the inside
/// corners are connected across it. Each loop runs counter-clockwise seen from the empty side.
std::vector<Loop> trace_loops(int sign_case, int joined) {
    std::array<int, edges> next;
    next.fill(-1);
    for (int f = 0; f < faces; ++f) {
        const auto& q = face_corners[f];
        const bool swap = is_ambiguous(sign_case, f) && (joined >> f & 1);
        for (int k = 0; k < 4; ++k) {  // an inside run begins at q[k]
            if (inside(sign_case, q[(k + 3) % 4]) || !inside(sign_case, q[k])) continue;
            int last = k;
            while (inside(sign_case, q[(last + 1) % 4])) last = (last + 1) % 4;
            const int enter = edge_between(q[(k + 3) % 4], q[k]),
                      leave = edge_between(q[last], q[(last + 1) % 4]);
            // Joined: the contour cuts off the empty corner before this run instead of the dense one.
            next[enter] = swap ? edge_between(q[(k + 2) % 4], q[(k + 3) % 4]) : leave;
        }
    }
    std::vector<Loop> loops;
    std::array<bool, edges> seen{};
    for (int e = 0; e < edges; ++e) {
        if (next[e] < 0 || seen[e]) continue;
        Loop loop;
        for (int k = e; !seen[k]; k = next[k]) {
            seen[k] = true;
            loop.push_back(k);
        }
        loops.push_back(loop);
    }
    return loops;
}

/// Squared distance of two edges' midpoints, in quarter units.
int distance2(int a, int b) {
    int sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const auto place = [&](int e) {
            return (lower_corner(e) >> axis & 1) + (upper_corner(e) >> axis & 1);
        };
        sum += (place(a) - place(b)) * (place(a) - place(b));
    }
    return sum;
}

// A diagonal inside a face of the cell could also be made by the neighbour cell, and four triangles would
// then meet in it. So no edge between triangles may join two crossings of one face.
constexpr int forbidden = 1 << 20;
int diagonal_cost(int a, int b) { return share_a_face(a, b) ? forbidden : distance2(a, b); }

void add(Pattern& p, int a, int b, int c) {
    if (p.triangle_count >= max_triangles) std::abort();
    p.triangles[p.triangle_count++] = {static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b),
                                       static_cast<std::uint8_t>(c)};
}

std::uint16_t mask_of(const Loop& loop) {
    std::uint16_t mask = 0;
    for (const int e : loop) mask |= static_cast<std::uint16_t>(1 << e);
    return mask;
}

/// Triangulates a disc bounded by the loop with the shortest allowed diagonals (dynamic programming over
/// sub-polygons); where there are none, a fan about an extra vertex.
void add_disc(Pattern& p, const Loop& loop) {
    const int n = static_cast<int>(loop.size());
    std::vector<std::vector<int>> cost(n, std::vector<int>(n, 0)), split(n, std::vector<int>(n, -1));
    const auto side = [&](int i, int j) {
        return j == i + 1 || (i == 0 && j == n - 1) ? 0 : diagonal_cost(loop[i], loop[j]);
    };
    for (int span = 2; span < n; ++span)
        for (int i = 0; i + span < n; ++i) {
            const int j = i + span;
            cost[i][j] = std::numeric_limits<int>::max();
            for (int k = i + 1; k < j; ++k) {
                const int c = cost[i][k] + cost[k][j] + side(i, k) + side(k, j);
                if (c < cost[i][j]) cost[i][j] = c, split[i][j] = k;
            }
        }
    if (cost[0][n - 1] >= forbidden) {
        const int centre = edges + p.centre_count;
        for (int i = 0; i < n; ++i) add(p, loop[i], loop[(i + 1) % n], centre);
        p.centre_edges[p.centre_count] = mask_of(loop);
        ++p.centre_count;
        return;
    }
    std::vector<std::pair<int, int>> open{{0, n - 1}};
    while (!open.empty()) {
        const auto [i, j] = open.back();
        open.pop_back();
        if (j - i < 2) continue;
        const int k = split[i][j];
        add(p, loop[i], loop[k], loop[j]);
        open.push_back({i, k});
        open.push_back({k, j});
    }
}

/// The wall of a tunnel between two loops, its triangles to be drawn for each cell. An edge inside a face of
/// the cell is forbidden here too, so loops that share a face have a ring of extra vertices between them.
void add_tunnel(Pattern& p, const Loop& a, const Loop& b) {
    if (a.size() > b.size()) return add_tunnel(p, b, a);
    Tunnel& t = p.tunnel;
    const auto take = [&](int which, const Loop& loop) {
        const auto k = static_cast<std::size_t>(which);
        t.size[k] = static_cast<std::uint8_t>(loop.size());
        std::copy(loop.begin(), loop.end(), t.loop[k].begin());
    };
    take(0, a);
    take(1, b);
    for (const int e : a)
        t.ring |= std::any_of(b.begin(), b.end(), [e](int f) { return share_a_face(e, f); });
    t.first_centre = p.centre_count;
    t.first_triangle = p.triangle_count;
    std::size_t triangles = a.size() + b.size();
    if (t.ring) {
        triangles += 2 * a.size();
        p.centre_count = static_cast<std::uint8_t>(p.centre_count + a.size());
    }
    p.triangle_count = static_cast<std::uint8_t>(p.triangle_count + triangles);
    if (p.triangle_count > max_triangles || p.centre_count > max_centres) std::abort();
}

/// Discs for all loops but the two that a tunnel joins (-1: none).
Pattern make_pattern(const std::vector<Loop>& loops, int tunnel_a, int tunnel_b) {
    Pattern p;
    for (int k = 0; k < static_cast<int>(loops.size()); ++k)
        if (k != tunnel_a && k != tunnel_b) add_disc(p, loops[k]);
    if (tunnel_a >= 0) add_tunnel(p, loops[tunnel_a], loops[tunnel_b]);
    return p;
}

// A slice z = t of the cell: its corners in cyclic order, as the cell's corners below them, and the edges of
// the cell below its sides.
constexpr int column[4] = {0, 1, 3, 2};
constexpr int bottom_edge[4] = {0, 5, 1, 4};  // x at y=0, y at x=1, x at y=1, y at x=0
constexpr int top_offset = 2;                 // to the same edges at z=1

/// Whether corner k is inside in a slice that alternates in sign.
constexpr bool is_inside_slice(int k, int diagonal) { return (k & 1) == diagonal; }

/// The two loops that the arcs of an alternating slice belong to; nothing where the cell has no such slice or
/// all belong to one. Along a side face the arcs' ends follow a contour, which is part of one loop, so arcs
/// of two loops lie in one piece only where they meet inside the cell.
std::optional<std::pair<int, int>> loops_of_slice(int sign_case, int diagonal,
                                                  const std::array<int, edges>& loop_of_edge) {
    std::array<bool, 4> from_bottom, to_top;
    for (int k = 0; k < 4; ++k) {
        from_bottom[k] = inside(sign_case, column[k]) == is_inside_slice(k, diagonal);
        to_top[k] = inside(sign_case, column[k] + 4) == is_inside_slice(k, diagonal);
        if (!from_bottom[k] && !to_top[k]) return std::nullopt;
    }
    std::optional<std::pair<int, int>> pair;
    int first = -1;
    for (int k = 0; k < 4; ++k) {
        const int next = (k + 1) % 4;
        const int edge = from_bottom[k] && from_bottom[next] ? bottom_edge[k]
                         : to_top[k] && to_top[next]         ? bottom_edge[k] + top_offset
                                                             : 8 + column[k];
        const int loop = loop_of_edge[edge];
        if (first < 0) first = loop;
        if (loop != first && !pair) pair = std::minmax({first, loop});
    }
    return pair;
}

struct Tables : PatternTable {
    Tables() {
        for (int c = 0; c < 256; ++c) {
            int ambiguous = 0;
            for (int f = 0; f < faces; ++f) ambiguous |= is_ambiguous(c, f) << f;
            for (int joined = 0; joined < 1 << faces; ++joined) {
                PatternId& id = of_key[c | joined << corners];
                // The number with fewer bits came before.
                id = joined & ~ambiguous ? of_key[c | (joined & ambiguous) << corners] : add_case(c, joined);
            }
        }
    }

    PatternId add_pattern(const std::vector<Loop>& loops, int tunnel_a, int tunnel_b) {
        patterns.push_back(make_pattern(loops, tunnel_a, tunnel_b));
        tunnels.push_back({no_pattern, no_pattern});
        return static_cast<PatternId>(patterns.size() - 1);
    }

    PatternId add_case(int sign_case, int joined) {
        const std::vector<Loop> loops = trace_loops(sign_case, joined);
        std::array<int, edges> loop_of_edge;
        loop_of_edge.fill(-1);
        for (std::size_t k = 0; k < loops.size(); ++k)
            for (const int e : loops[k]) loop_of_edge[e] = static_cast<int>(k);
        const PatternId id = add_pattern(loops, -1, -1);
        bool settled = true;
        for (int diagonal = 0; diagonal < 2; ++diagonal)
            if (const auto pair = loops_of_slice(sign_case, diagonal, loop_of_edge)) {
                const PatternId tunnel = add_pattern(loops, pair->first, pair->second);
                tunnels[id][diagonal] = tunnel;
                settled = false;
            }
        return settled ? id : static_cast<PatternId>(id | unsettled);
    }
};

}  // namespace

const PatternTable& pattern_table() {
    static const Tables tables;
    return tables;
}

}  // namespace vdbgeo::cell
