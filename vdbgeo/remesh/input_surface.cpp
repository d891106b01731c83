#include "vdbgeo/remesh/input_surface.h"

#include <algorithm>
#include <cmath>

namespace vdbgeo {
namespace {

/// Where on a triangle a nearest point lies: inside, on the side from corner k to k + 1, at corner k.
struct Place {
    enum { inside, side, corner } where;
    std::uint32_t k = 0;
};

/// Nearest point of a triangle by the Voronoi regions of its corners and sides (Ericson 2005, Real-Time
/// Collision Detection, 5.1.5), as weights of the corners. A triangle without area is its longest side or a
/// point.
Place nearest_weights(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c, Vec3d& w) {
    const Vec3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
                 d6 = ac.dot(cp);
    if (d1 <= 0 && d2 <= 0) return w = {1, 0, 0}, Place{Place::corner, 0};
    if (d3 >= 0 && d4 <= d3) return w = {0, 1, 0}, Place{Place::corner, 1};
    if (d6 >= 0 && d5 <= d6) return w = {0, 0, 1}, Place{Place::corner, 2};
    const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        const double t = d1 / (d1 - d3);
        return w = {1 - t, t, 0}, Place{Place::side, 0};
    }
    if (va <= 0 && d4 >= d3 && d5 >= d6) {
        const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return w = {0, 1 - t, t}, Place{Place::side, 1};
    }
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        const double t = d2 / (d2 - d6);
        return w = {1 - t, 0, t}, Place{Place::side, 2};
    }
    const double sum = va + vb + vc;
    return w = {va / sum, vb / sum, vc / sum}, Place{Place::inside, 0};
}

Place place_on(const TriMesh& mesh, const Vec3d& p, std::uint32_t face, InputSurface::Spot& spot) {
    const Triangle& t = mesh.triangles[face];
    const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                c = mesh.points[t[2]].cast<double>();
    const Place place = nearest_weights(p, a, b, c, spot.weights);
    spot.point = spot.weights[0] * a + spot.weights[1] * b + spot.weights[2] * c;
    spot.face = face;
    spot.squared_distance = (p - spot.point).squaredNorm();
    return place;
}

double cosine_of(double degrees) { return std::cos(degrees * M_PI / 180); }

}  // namespace

InputSurface::InputSurface(const TriMesh& mesh, const FaceAdjacency& adjacency,
                           std::optional<double> feature_angle_deg, double length)
    : mesh_(mesh), adjacency_(adjacency) {
    find_lines(feature_angle_deg);
    if (!line_.empty()) find_corners(feature_angle_deg.value_or(45), length);
}

Vec3d InputSurface::normal(std::uint32_t face) const {
    const Triangle& t = mesh_.triangles[face];
    const Vec3d a = point(t[0]);
    return (point(t[1]) - a).cross(point(t[2]) - a).normalized();
}

bool InputSurface::turns(std::uint32_t h, double angle_deg) const {
    const Vec3d a = normal(h / 3), b = normal(adjacency_.twin[h] / 3);
    return !a.isZero() && !b.isZero() && a.dot(b) < cosine_of(angle_deg);
}

void InputSurface::find_lines(std::optional<double> feature_angle_deg) {
    const MeshProperty* cap = mesh_.find_face_property(cap_property);
    if (cap && cap->components != 1) cap = nullptr;
    const auto is_line = [&](std::uint32_t h) {
        const std::uint32_t twin = adjacency_.twin[h];
        if (twin == none) return true;
        if (cap && cap->values[h / 3] != cap->values[twin / 3]) return true;
        if (cap && cap->values[h / 3] > 0.5f && turns(h, 45)) return true;
        return feature_angle_deg && turns(h, *feature_angle_deg);
    };
    for (std::uint32_t h = 0; h < adjacency_.twin.size(); ++h) {
        if (adjacency_.twin[h] < h || !is_line(h)) continue;
        if (line_.empty()) line_.resize(adjacency_.twin.size(), false);
        line_[h] = true;
        if (adjacency_.twin[h] != none) line_[adjacency_.twin[h]] = true;
    }
}

void InputSurface::find_corners(double angle_deg, double length) {
    kind_.resize(mesh_.points.size(), Kind::free);
    lines_.resize(mesh_.points.size(), {none, none});
    for (std::uint32_t h = 0; h < line_.size(); ++h) {
        if (!line_[h] || lower(h) != h) continue;
        for (const VertexId v : {from(h), to(h)}) {
            auto& lines = lines_[v];
            if (lines[0] == none) {
                lines[0] = h, kind_[v] = Kind::line;
            } else if (lines[1] == none) {
                lines[1] = h;
            } else {
                kind_[v] = Kind::corner;
            }
        }
    }
    for (std::size_t v = 0; v < kind_.size(); ++v)
        if (kind_[v] == Kind::line && lines_[v][1] == none) kind_[v] = Kind::corner;
    std::vector<VertexId> bent;
    for (std::size_t v = 0; v < kind_.size(); ++v)
        if (kind_[v] == Kind::line && bends(static_cast<VertexId>(v), cosine_of(angle_deg), length))
            bent.push_back(static_cast<VertexId>(v));
    for (const VertexId v : bent) kind_[v] = Kind::corner;
}

/// At the vertex itself, and between the points of the line that are `length` away: a staircase is no corner.
bool InputSurface::bends(VertexId v, double cosine, double length) const {
    const Vec3d p = point(v);
    std::array<Vec3d, 2> near, far;
    for (std::size_t side = 0; side < 2; ++side) {
        std::uint32_t s = lines_[v][side];
        VertexId end = from(s) == v ? to(s) : from(s);
        near[side] = (point(end) - p).normalized();
        for (int step = 0; step < 100 && kind_[end] == Kind::line && (point(end) - p).norm() < length;
             ++step) {
            s = lines_[end][lines_[end][0] == s ? 1 : 0];
            end = from(s) == end ? to(s) : from(s);
        }
        far[side] = (point(end) - p).normalized();
    }
    return -near[0].dot(near[1]) < cosine && -far[0].dot(far[1]) < cosine;
}

InputSurface::Spot InputSurface::on_face(const Vec3d& p, std::uint32_t face) const {
    Spot spot;
    place_on(mesh_, p, face, spot);
    return spot;
}

InputSurface::Spot InputSurface::nearest(const Vec3d& p, std::uint32_t face) const {
    Spot best;
    Place place = place_on(mesh_, p, face, best);
    // The distance falls at every step, so the walk ends; the bound is against rounding.
    for (int step = 0; step < 1000 && place.where != Place::inside; ++step) {
        const std::uint32_t h = 3 * best.face + place.k;
        const double to_beat = best.squared_distance * (1 - 1e-12);
        Spot other, found = best;
        Place found_place = place;
        const auto look = [&](std::uint32_t at) {
            const Place there = place_on(mesh_, p, at / 3, other);
            if (other.squared_distance < found.squared_distance) found = other, found_place = there;
        };
        if (place.where == Place::side) {
            if (adjacency_.twin[h] != none) look(adjacency_.twin[h]);
        } else {
            const std::uint32_t first = adjacency_.outgoing[from(h)];
            std::uint32_t at = first;
            do {
                if (at / 3 != best.face) look(at);
                at = adjacency_.around(at);
            } while (at != none && at != first);
        }
        if (!(found.squared_distance < to_beat)) break;
        best = found;
        place = found_place;
    }
    return best;
}

InputSurface::LineSpot InputSurface::nearest_on_line(const Vec3d& p, std::uint32_t segment) const {
    const auto on_segment = [&](std::uint32_t s, double& t) {
        const Vec3d a = point(from(s)), d = point(to(s)) - a;
        const double length = d.squaredNorm();
        t = length > 0 ? std::clamp((p - a).dot(d) / length, 0.0, 1.0) : 0.0;
        const Vec3d q = a + t * d;
        return LineSpot{q, s, (p - q).squaredNorm()};
    };
    double t = 0;
    LineSpot best = on_segment(segment, t);
    for (int step = 0; step < 10000 && (t == 0 || t == 1); ++step) {
        const VertexId end = t == 0 ? from(best.segment) : to(best.segment);
        if (kind_[end] != Kind::line) break;
        const auto& lines = lines_[end];
        const LineSpot other = on_segment(lines[lines[0] == best.segment ? 1 : 0], t);
        if (!(other.squared_distance < best.squared_distance)) break;
        best = other;
    }
    return best;
}

}  // namespace vdbgeo
