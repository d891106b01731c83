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
        p.around_edges[p.centre_count] = p.centre_edges[p.centre_count] = mask_of(loop);
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

/// A walk once around loop a forwards and once around loop b backwards, every step one triangle of the band
/// between them: true for a step along a. It begins at the cross edge a[start_a] – b[start_b].
struct Band {
    std::vector<bool> along_a;
    int start_a = 0, start_b = 0;
};

/// The walk with the shortest cross edges, by dynamic programming over the lattice of cross edges for every
/// start. Returns its cost, `forbidden` or more where no walk does without a forbidden cross edge.
template <class Cost>
int find_band(const Loop& a, const Loop& b, const Cost& edge_cost, Band& band) {
    const int n = static_cast<int>(a.size()), m = static_cast<int>(b.size());
    int best = std::numeric_limits<int>::max();
    for (int start = 0; start < n * m; ++start) {
        const int start_a = start % n, start_b = start / n;
        std::vector<std::vector<int>> cost(n + 1, std::vector<int>(m + 1, 2 * forbidden));
        std::vector<std::vector<bool>> from_a(n + 1, std::vector<bool>(m + 1, false));
        cost[0][0] = 0;
        // A walk begins along a and ends along b, and does not go around one loop at a stretch: it would come
        // back to the same cross edge. So the lattice's side i = 0 and its corner (n, 0) are left out.
        for (int i = 1; i <= n; ++i)
            for (int j = 0; j <= m; ++j) {
                if ((i == n && j == 0) || (i < n && j == m)) continue;
                const int via_a = cost[i - 1][j], via_b = j > 0 ? cost[i][j - 1] : 2 * forbidden;
                from_a[i][j] = via_a <= via_b;
                const int step = edge_cost(a[(start_a + i) % n], b[(start_b - j + 2 * m) % m]);
                cost[i][j] = std::min(2 * forbidden, std::min(via_a, via_b) + step);
            }
        if (cost[n][m] >= best) continue;
        best = cost[n][m];
        if (best >= forbidden) continue;
        band = {{}, start_a, start_b};
        for (int i = n, j = m; i + j > 0;) {
            band.along_a.push_back(from_a[i][j]);
            --(band.along_a.back() ? i : j);
        }
        std::reverse(band.along_a.begin(), band.along_a.end());
    }
    return best;
}

/// Three steps of the walk that part it so that neither loop lies in one part alone; the parts as even as may
/// be.
std::array<int, 3> part_in_three(const Band& band) {
    const int steps = static_cast<int>(band.along_a.size());
    std::array<int, 3> best{};
    int longest = steps + 1;
    for (int p = 0; p < steps; ++p)
        for (int q = p + 1; q < steps; ++q)
            for (int r = q + 1; r < steps; ++r) {
                const std::array<int, 4> cut{p, q, r, p + steps};
                int with_a = 0, with_b = 0, most = 0;
                for (int k = 0; k < 3; ++k) {
                    bool a = false, b = false;
                    for (int s = cut[k]; s < cut[k + 1]; ++s) (band.along_a[s % steps] ? a : b) = true;
                    with_a += a;
                    with_b += b;
                    most = std::max(most, cut[k + 1] - cut[k]);
                }
                if (with_a > 1 && with_b > 1 && most < longest) longest = most, best = {p, q, r};
            }
    return best;
}

/// The wall of a tunnel between two loops. Where every band has an edge inside a face of the cell, the cross
/// edges run over a ring of three extra vertices. Each is drawn from the middle of the crossings that it is
/// joined to, all of which may lie in one face, towards the middle of the tunnel: a vertex in a face could
/// meet another of the neighbour cell.
void add_tunnel(Pattern& p, const Loop& a, const Loop& b) {
    const int n = static_cast<int>(a.size()), m = static_cast<int>(b.size());
    Band band;
    const bool direct = find_band(a, b, diagonal_cost, band) < forbidden;
    if (!direct) find_band(a, b, distance2, band);
    int i = 0, j = 0;
    const auto at_a = [&] { return a[(band.start_a + i) % n]; };
    const auto at_b = [&] { return b[(band.start_b - j + 2 * m) % m]; };
    const std::array<int, 3> cut = direct ? std::array<int, 3>{-1, -1, -1} : part_in_three(band);
    const int ring = p.centre_count;
    const auto add_to_centre = [&](int place) {
        p.centre_edges[ring + place] |= static_cast<std::uint16_t>(1 << at_a() | 1 << at_b());
    };
    int place = 2;  // the last ring vertex before the first cut
    for (int s = 0; s < n + m; ++s) {
        if (place < 2 ? s == cut[place + 1] : s == cut[0]) {
            const int before = place;
            place = (place + 1) % 3;
            add_to_centre(place);
            add(p, edges + ring + place, edges + ring + before, at_a());
            add(p, edges + ring + before, edges + ring + place, at_b());
        }
        const int from_a = at_a(), from_b = at_b(), centre = edges + ring + place;
        ++(band.along_a[s] ? i : j);
        if (!direct) add_to_centre(place);
        if (band.along_a[s])
            add(p, from_a, at_a(), direct ? from_b : centre);
        else
            add(p, at_b(), from_b, direct ? from_a : centre);
    }
    if (direct) return;
    for (int k = ring; k < ring + 3; ++k)
        p.around_edges[k] = static_cast<std::uint16_t>(mask_of(a) | mask_of(b));
    p.centre_count += 3;
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
