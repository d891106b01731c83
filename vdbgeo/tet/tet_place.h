// Where a vertex of a tetrahedral mesh may be put, and what that does to the boundary. For tet_optimize.
#pragma once

#include <optional>

#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/tet/tet_store.h"

namespace vdbgeo {

/// Tetrahedra are not made longer than this, circumradius over shortest edge, or than the longest around is:
/// angles alone let edges shrink to nothing.
inline constexpr double stretch_limit = 2.5;

inline Vec3d area_vector(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return (b - a).cross(c - a); }

/// The unit normal of the boundary at one of its vertices, weighted by area; `point` gives places by vertex.
template <class Point>
Vec3d surface_normal(const TetStore& store, VertexId v, const Point& point) {
    Vec3d n = Vec3d::Zero();
    store.for_fan(v, [&](const Triangle& f) { n += area_vector(point(f[0]), point(f[1]), point(f[2])); });
    const double length = n.norm();
    return length > 0 ? Vec3d(n / length) : Vec3d(Vec3d::Zero());
}

/// Whether none of the boundary's triangles around v turns by more than 60° when vertices go from the places
/// `from` to the places `to`, and none comes nearer to lying against its neighbour than 60° (or than it did).
template <class From, class To>
bool surface_holds(const TetStore& store, VertexId v, const From& from, const To& to) {
    constexpr double turn = 0.5, fold = -0.5;  // cosines
    bool good = true;
    store.for_fan(v, [&](const Triangle& f) {
        const Vec3d before = area_vector(from(f[0]), from(f[1]), from(f[2])).normalized(),
                    after = area_vector(to(f[0]), to(f[1]), to(f[2])).normalized();
        if (!good || !(before.dot(after) > turn)) good = false;
        if (!good) return;
        store.for_fan(v, [&](const Triangle& g) {
            if (g[1] != f[2]) return;  // the next one around v
            const double now = after.dot(area_vector(to(g[0]), to(g[1]), to(g[2])).normalized());
            if (now > fold) return;
            good = good && now >= before.dot(area_vector(from(g[0]), from(g[1]), from(g[2])).normalized());
        });
    });
    return good;
}

/// Where a step d from x leads that is at most `longest`: on the surface for vertices of it. Nothing where
/// the projection finds nothing, or a place that is much farther away.
inline std::optional<Vec3d> step_of(VertexFreedom freedom, const Vec3d& x, Vec3d d, double longest,
                                    const SurfaceProjection& onto_surface) {
    const double length = d.norm();
    if (length > longest) d *= longest / length;
    if (freedom == VertexFreedom::free) return x + d;
    if (d.isZero(0)) return x;
    const std::optional<Vec3d> landed = onto_surface(x + d);
    if (!landed || !((*landed - x).norm() <= 2 * d.norm())) return std::nullopt;
    return landed;
}

}  // namespace vdbgeo
