// Rays along +x against triangles: which piece of a mesh lies in which.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Where a ray along +x goes through a triangle.
struct RayCrossing {
    double x;
    bool leaving;  ///< through the back: out of what the triangle's normal points away from
};

/// Rays from given points, in bins over y and z. A ray is taken to run beside its point by (ε, ε²) in y and
/// z, so that it meets no vertex and no edge: it crosses a closed surface in an even or odd number of
/// triangles for certain, as long as differences of coordinates are exact in double.
class RayBins {
 public:
    /// At least one point.
    explicit RayBins(std::vector<Vec3f> starts) : starts_(std::move(starts)) {
        low_ = high_ = starts_.front().tail<2>().cast<double>();
        for (const Vec3f& p : starts_) {
            low_ = low_.cwiseMin(p.tail<2>().cast<double>());
            high_ = high_.cwiseMax(p.tail<2>().cast<double>());
        }
        rows_ = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::sqrt(double(starts_.size()))));
        for (const int a : {0, 1}) scale_[a] = high_[a] > low_[a] ? double(rows_) / (high_[a] - low_[a]) : 0;
        first_.assign(static_cast<std::size_t>(rows_ * rows_) + 1, 0);
        for (const Vec3f& p : starts_) ++first_[bin(p) + 1];
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        rays_.resize(starts_.size());
        std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
        for (std::uint32_t i = 0; i < starts_.size(); ++i) rays_[next[bin(starts_[i])]++] = i;
    }

    /// Calls visit(ray, crossing) for the rays that go through a triangle beyond their starts.
    template <class Visit>
    void visit(const TriMesh& mesh, const Triangle& t, const Visit& visit) const {
        std::array<Vec3d, 3> p;
        for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[t[k]].cast<double>();
        const Vec3d low = p[0].cwiseMin(p[1]).cwiseMin(p[2]), high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
        if (high.y() < low_[0] || high.z() < low_[1] || low.y() > high_[0] || low.z() > high_[1]) return;
        for (std::int64_t z = row(low.z(), 1); z <= row(high.z(), 1); ++z)
            for (std::int64_t y = row(low.y(), 0); y <= row(high.y(), 0); ++y) {
                const auto b = static_cast<std::size_t>(z * rows_ + y);
                for (std::uint32_t i = first_[b]; i < first_[b + 1]; ++i)
                    if (const auto crossing = cross(p, starts_[rays_[i]].cast<double>()))
                        visit(rays_[i], *crossing);
            }
    }

 private:
    /// Twice the area of (a, b, p) over y and z. Products of differences of floats are exact, and so is its
    /// sign.
    static double turn(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
        return (b.y() - a.y()) * (p.z() - a.z()) - (b.z() - a.z()) * (p.y() - a.y());
    }

    /// Whether p lies left of (a, b), moved by (ε, ε²).
    static bool left(double turned, const Vec3d& a, const Vec3d& b) {
        if (turned != 0) return turned > 0;
        return b.z() != a.z() ? b.z() < a.z() : b.y() > a.y();
    }

    static std::optional<RayCrossing> cross(const std::array<Vec3d, 3>& t, const Vec3d& p) {
        const double a = turn(t[1], t[2], p), b = turn(t[2], t[0], p), c = turn(t[0], t[1], p);
        const bool inside = left(a, t[1], t[2]);
        if (a + b + c == 0 || left(b, t[2], t[0]) != inside || left(c, t[0], t[1]) != inside)
            return std::nullopt;
        const double x = (a * t[0].x() + b * t[1].x() + c * t[2].x()) / (a + b + c);
        if (!(x > p.x())) return std::nullopt;
        return RayCrossing{x, inside};
    }

    std::int64_t row(double at, int a) const {
        return static_cast<std::int64_t>(std::clamp((at - low_[a]) * scale_[a], 0.0, double(rows_ - 1)));
    }
    std::size_t bin(const Vec3f& p) const {
        return static_cast<std::size_t>(row(double(p.z()), 1) * rows_ + row(double(p.y()), 0));
    }

    std::vector<Vec3f> starts_;
    Eigen::Vector2d low_, high_;
    double scale_[2];
    std::int64_t rows_;
    std::vector<std::uint32_t> first_, rays_;
};

/// The point of each of some pieces that lies farthest in x, the first of equals; ray_of[piece] is its place,
/// or 2^32 − 1 for the pieces that are left out.
inline std::vector<Vec3f> farthest_in_x(const TriMesh& mesh, const std::vector<std::uint32_t>& of_face,
                                        const std::vector<std::uint32_t>& ray_of, std::size_t rays) {
    std::vector<Vec3f> starts(rays, Vec3f::Constant(-std::numeric_limits<float>::infinity()));
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        if (ray_of[of_face[f]] == 0xFFFFFFFFu) continue;
        Vec3f& start = starts[ray_of[of_face[f]]];
        for (const VertexId v : mesh.triangles[f])
            if (mesh.points[v].x() > start.x()) start = mesh.points[v];
    }
    return starts;
}

}  // namespace vdbgeo
