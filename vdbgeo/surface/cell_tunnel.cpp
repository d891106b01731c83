#include "vdbgeo/surface/cell_tunnel.h"

#include <algorithm>
#include <limits>

namespace vdbgeo::cell {
namespace {

/// A closed polygon: the numbers of its vertices in the pattern, and where they lie seen from the view point.
struct Polygon {
    int size = 0;
    std::array<int, edges> vertex{};
    std::array<Vec3d, edges> place;

    void add(int v, const Vec3d& at) {
        const auto k = static_cast<std::size_t>(size++);
        vertex[k] = v;
        place[k] = at;
    }
    std::size_t wrap(int i) const { return static_cast<std::size_t>((i + size) % size); }
};

/// A walk once around two polygons, every step one triangle of the band between them: true for a step along
/// the first. It begins at the cross edge of the vertices numbered `start`.
struct Band {
    double score = -2;  ///< the least of its triangles' views, all above 0 where it is not cut
    int start[2] = {0, 0};
    int steps = 0;
    std::array<bool, 2 * edges> along_first{};
};

/// How squarely a triangle faces away from the origin: the volume that it spans with it, over the product of
/// the distances. Negative where it shows its back.
double view(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const double scale = a.norm() * b.norm() * c.norm();
    return scale > 0 ? a.dot(b.cross(c)) / scale : 0;
}

/// The band around `a` forwards and `b` backwards whose least view is greatest, by dynamic programming over
/// the lattice of cross edges for every start. `sign`: −1 for a wall that faces the origin.
Band find_band(const Polygon& a, const Polygon& b, int sign) {
    constexpr double never = -2;
    const int n = a.size, m = b.size;
    std::array<std::array<double, edges>, edges> along_a, along_b;  // triangles by the edge they step from
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < m; ++j) {
            const std::size_t p = a.wrap(i), q = b.wrap(-j);
            along_a[p][q] = sign * view(a.place[p], a.place[a.wrap(i + 1)], b.place[q]);
            along_b[p][q] = sign * view(b.place[b.wrap(-j - 1)], b.place[q], a.place[p]);
        }
    Band best;
    std::array<std::array<double, edges + 1>, edges + 1> score;
    std::array<std::array<bool, edges + 1>, edges + 1> from_a{};
    for (int start = 0; start < n * m; ++start) {
        const int start_a = start % n, start_b = start / n;
        for (auto& row : score) row.fill(never);
        score[0][0] = 1;
        // A walk begins along a and ends along b, and does not go around one loop at a stretch: it would come
        // back to the same cross edge. So the lattice's side i = 0 and its corner (n, 0) are left out.
        for (int i = 1; i <= n; ++i)
            for (int j = 0; j <= m; ++j) {
                if ((i == n && j == 0) || (i < n && j == m)) continue;
                const auto k = static_cast<std::size_t>(i), l = static_cast<std::size_t>(j);
                const double via_a = std::min(score[k - 1][l],
                                              along_a[a.wrap(start_a + i - 1)][b.wrap(start_b - j + m)]),
                             via_b = j > 0
                                         ? std::min(score[k][l - 1],
                                                    along_b[a.wrap(start_a + i)][b.wrap(start_b - j + 1 + m)])
                                         : never;
                from_a[k][l] = via_a >= via_b;
                score[k][l] = std::max(via_a, via_b);
            }
        const double reached = score[static_cast<std::size_t>(n)][static_cast<std::size_t>(m)];
        if (reached <= best.score) continue;
        best.score = reached;
        best.start[0] = start_a;
        best.start[1] = start_b;
        best.steps = n + m;
        for (int i = n, j = m, s = n + m; s > 0;) {
            const bool step = from_a[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
            best.along_first[static_cast<std::size_t>(--s)] = step;
            --(step ? i : j);
        }
    }
    return best;
}

/// Writes a band's triangles from `next` on.
void draw_band(const Band& band, const Polygon& a, const Polygon& b, Pattern& pattern, std::size_t& next) {
    int i = band.start[0], j = band.start[1];
    for (int s = 0; s < band.steps; ++s) {
        const int p = a.vertex[a.wrap(i)], q = b.vertex[b.wrap(j)];
        const bool step = band.along_first[static_cast<std::size_t>(s)];
        step ? i = (i + 1) % a.size : j = (j + b.size - 1) % b.size;
        const std::array<int, 3> t = step ? std::array<int, 3>{p, a.vertex[a.wrap(i)], q}
                                          : std::array<int, 3>{b.vertex[b.wrap(j)], q, p};
        for (std::size_t v = 0; v < 3; ++v) pattern.triangles[next][v] = static_cast<std::uint8_t>(t[v]);
        ++next;
    }
}

Vec3d mean(const Polygon& p) {
    Vec3d sum = Vec3d::Zero();
    for (int i = 0; i < p.size; ++i) sum += p.place[static_cast<std::size_t>(i)];
    return sum / p.size;
}

/// The point of a polygon's outline that is nearest to p.
Vec3d nearest_on(const Polygon& polygon, const Vec3d& p) {
    Vec3d nearest = polygon.place[0];
    for (int i = 0; i < polygon.size; ++i) {
        const Vec3d& from = polygon.place[polygon.wrap(i)];
        const Vec3d along = polygon.place[polygon.wrap(i + 1)] - from;
        const double t = std::clamp((p - from).dot(along) / along.squaredNorm(), 0.0, 1.0);
        if ((from + t * along - p).squaredNorm() < (nearest - p).squaredNorm()) nearest = from + t * along;
    }
    return nearest;
}

Polygon reversed(Polygon p) {
    std::reverse(p.vertex.begin(), p.vertex.begin() + p.size);
    std::reverse(p.place.begin(), p.place.begin() + p.size);
    return p;
}

/// 1 where the wall between the loops faces away from the tunnel, −1 where it faces inwards.
int facing(const Polygon& a, const Polygon& b) {
    const Vec3d towards = mean(b) - mean(a);
    double sum = 0;
    for (int i = 0; i < a.size; ++i) sum += a.place[a.wrap(i)].cross(a.place[a.wrap(i + 1)]).dot(towards);
    return sum >= 0 ? 1 : -1;
}

void move(Polygon& p, const Vec3d& by) {
    for (int i = 0; i < p.size; ++i) p.place[static_cast<std::size_t>(i)] += by;
}

/// A vertex for each of a's, `part` of the way to b and from there half of the way to the origin: both ends
/// may lie in one face of the cell, where it could meet one of the neighbour's.
Polygon ring_between(const Polygon& a, const Polygon& b, double part, int first_vertex) {
    Polygon ring;
    for (int i = 0; i < a.size; ++i) {
        const Vec3d& from = a.place[static_cast<std::size_t>(i)];
        ring.add(first_vertex + i, 0.5 * (from + part * (nearest_on(b, from) - from)));
    }
    return ring;
}

}  // namespace

void make_tunnel(Pattern& pattern, const std::array<Vec3d, edges>& crossings,
                 std::array<Vec3d, max_centres>& centres) {
    const Tunnel& tunnel = pattern.tunnel;
    Polygon a, b;
    for (int i = 0; i < tunnel.size[0]; ++i) a.add(tunnel.loop[0][i], crossings[tunnel.loop[0][i]]);
    for (int i = 0; i < tunnel.size[1]; ++i) b.add(tunnel.loop[1][i], crossings[tunnel.loop[1][i]]);
    const Vec3d mean_a = mean(a), mean_b = mean(b);
    const int sign = facing(a, b);
    std::size_t next = tunnel.first_triangle;
    if (!tunnel.ring) {
        const Vec3d middle = 0.5 * (mean_a + mean_b);
        move(a, -middle);
        move(b, -middle);
        return draw_band(find_band(a, b, sign), a, b, pattern, next);
    }

    constexpr double enough = 0.02;
    double best = -3;
    Polygon ring;
    Band first, second;
    Vec3d middle = Vec3d::Zero(), now = middle;
    for (const double along : {0.5, 0.25, 0.75, 0.1, 0.9, 0.02}) {
        const Vec3d view_point = mean_a + along * (mean_b - mean_a);
        move(a, now - view_point);
        move(b, now - view_point);
        now = view_point;
        for (const double part : {0.5, 0.25, 0.75, 0.125, 0.0625, 0.03125}) {
            const Polygon trial = ring_between(a, b, part, edges + tunnel.first_centre);
            const Band to_ring = find_band(a, reversed(trial), sign), from_ring = find_band(trial, b, sign);
            const double score = std::min(to_ring.score, from_ring.score);
            if (score <= best) continue;
            best = score;
            ring = trial;
            first = to_ring;
            second = from_ring;
            middle = view_point;
            if (best > enough) break;
        }
        if (best > enough) break;
    }
    draw_band(first, a, reversed(ring), pattern, next);
    draw_band(second, ring, b, pattern, next);
    for (int i = 0; i < ring.size; ++i)
        centres[static_cast<std::size_t>(tunnel.first_centre + i)] =
            middle + ring.place[static_cast<std::size_t>(i)];
}

}  // namespace vdbgeo::cell
