#include "vdbgeo/measure/patch_fit.h"

#include <algorithm>
#include <cmath>

namespace vdbgeo {
namespace {

/// Scaled pivot of the normal equations of degree 2 below which the points do not tell a curvature from a
/// tilt: even ones give 0.1 to 0.5. Those of degree 4 are smaller by nature.
constexpr double least_pivot = 1e-3;

}  // namespace

PatchFit::PatchFit(const FitSurface& surface)
    : surface_(surface), patch_(surface.mesh(), surface.neighbours()) {}

bool PatchFit::ball(VertexId v, double radius, int degree, FittedCurvature& out) {
    gather(v, patch_.ball(v, radius), radius, 0);
    return fit(degree, out);
}

bool PatchFit::rings(VertexId v, int k, int degree, FittedCurvature& out) {
    const auto& members = patch_.rings(v, k);
    double reach = 0;
    for (const auto& m : members)
        reach = std::max(reach, (surface_.point(m.vertex) - surface_.point(v)).squaredNorm());
    gather(v, members, std::sqrt(reach), k);
    return fit(degree, out);
}

bool PatchFit::sphere(VertexId v, FittedCurvature& out) {
    const Vec3d normal = surface_.normal(v).cast<double>();
    if (!(normal.squaredNorm() > 0)) return false;
    frame_ = TangentFrame(normal.normalized());
    points_.clear();
    double reach = 0;
    for (const auto& m : patch_.rings(v, 2)) {
        points_.push_back({frame_.local(surface_.point(m.vertex) - surface_.point(v)), 1});
        reach = std::max(reach, points_.back().at.squaredNorm());
    }
    if (points_.size() < 4 || !(reach > 0)) return false;
    scale_ = 1 / std::sqrt(reach);
    for (Point& p : points_) p.at *= scale_;
    if (!find_sphere()) return false;
    out.k1 = out.k2 = scale_ * bend_;
    out.direction1 = frame_.world(turned_.x);
    out.direction2 = frame_.world(turned_.y);
    out.normal = frame_.world(turned_.z);
    out.degree = 0;
    return std::isfinite(out.k1);
}

void PatchFit::gather(VertexId v, const std::vector<VertexPatch::Member>& members, double radius, int rings) {
    points_.clear();
    const Vec3d normal = surface_.normal(v).cast<double>();
    if (!(normal.squaredNorm() > 0) || !(radius > 0)) return;
    frame_ = TangentFrame(normal.normalized());
    scale_ = 1 / radius;
    const Vec3d centre = surface_.point(v);
    for (const auto& m : members) {
        // What faces away belongs to the other side of a sheet or the far side of a needle.
        const double facing = frame_.z.dot(surface_.normal(m.vertex).cast<double>());
        if (!(facing > 0)) continue;
        const Vec3d p = scale_ * frame_.local(surface_.point(m.vertex) - centre);
        double weight = facing;
        if (rings > 0) {
            const double ring = static_cast<double>(m.distance) / (rings + 1), window = 1 - ring * ring;
            weight *= window * window * window;
        } else {
            const double window = std::max(0.0, 1 - p.squaredNorm());
            weight *= window * window * surface_.area(m.vertex) * scale_ * scale_;
        }
        if (weight > 0) points_.push_back({p, weight});
    }
}

bool PatchFit::fit(int degree, FittedCurvature& out) {
    if (points_.size() < JetSums<2>::unknowns) return false;
    find_sphere();  // without one the plane serves
    return (degree == 4 && fit_jet<4>(out)) || (degree >= 3 && fit_jet<3>(out)) || fit_jet<2>(out);
}

/// The algebraic sphere z = a + b x + c y − κ|p|²/2 (linear least squares), the point of it nearest to the
/// vertex, and its frame there.
bool PatchFit::find_sphere() {
    foot_ = Vec3d::Zero();
    bend_ = 0;
    turned_ = TangentFrame(Vec3d(0, 0, 1));
    std::array<std::array<double, 4>, 4> a{};
    std::array<double, 4> b{};
    for (const Point& q : points_) {
        const std::array<double, 4> f{1, q.at[0], q.at[1], -0.5 * q.at.squaredNorm()};
        for (std::size_t i = 0; i < 4; ++i) {
            const double w = q.weight * f[i];
            for (std::size_t j = 0; j <= i; ++j) a[i][j] += w * f[j];
            b[i] += w * q.at[2];
        }
    }
    if (!solve_positive<4>(a, b, 1e-6)) return false;
    // F(p) = −a + (−b, −c, 1)·p + κ|p|²/2, scaled so that its gradient is of length 1 where F = 0.
    Vec3d slope(-b[1], -b[2], 1);
    const double discriminant = slope.squaredNorm() + 2 * b[0] * b[3];
    if (!(discriminant > 0)) return false;
    const double length = std::sqrt(discriminant);
    slope /= length;
    bend_ = b[3] / length;
    const double offset = -b[0] / length, s = slope.norm();
    foot_ = slope / s * (-2 * offset / (s + std::sqrt(std::max(0.0, s * s - 2 * offset * bend_))));
    turned_ = TangentFrame((slope + bend_ * foot_).normalized());
    return true;
}

/// The conformal map of space that takes the sphere to the plane z = 0 and changes neither lengths nor
/// angles at its foot: y → (y + ½κ|y|² e_z) / |…|², an inversion between two others.
Vec3d PatchFit::flattened(const Vec3d& p) const {
    Vec3d y = turned_.local(p - foot_);
    const double square = y.squaredNorm(), half = 0.5 * bend_;
    const double divisor = 1 + 2 * half * y[2] + half * half * square;
    y[2] += half * square;
    return y / divisor;
}

template <int Degree>
bool PatchFit::fit_jet(FittedCurvature& out) {
    if (points_.size() < JetSums<Degree>::unknowns) return false;
    JetSums<Degree> sums;
    sums.clear();
    for (const Point& q : points_) {
        const Vec3d y = flattened(q.at);
        sums.add(y[0], y[1], y[2], q.weight);
    }
    typename JetSums<Degree>::Coefficients c;
    if (!sums.solve(c, Degree == 2 ? least_pivot : 1e-3 * least_pivot)) return false;
    const GraphCurvature k(c[1], c[2], 2 * c[3], c[4], 2 * c[5]);
    out.k1 = scale_ * (k.first + bend_);
    out.k2 = scale_ * (k.second + bend_);
    const auto world = [&](const Vec3d& d) { return frame_.world(turned_.world(d)); };
    out.direction1 = world(k.first_direction);
    out.direction2 = world(k.second_direction);
    out.normal = world(k.normal);
    out.degree = Degree;
    return std::isfinite(out.k1) && std::isfinite(out.k2);
}

}  // namespace vdbgeo
