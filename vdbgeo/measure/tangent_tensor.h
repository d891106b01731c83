// A sum of axes, and what it is within a plane.
#pragma once

#include <cmath>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Σ w a aᵀ, symmetric.
class TangentTensor {
 public:
    void add(const Vec3d& a, double weight) {
        const Vec3d scaled = weight * a;
        xx_ += scaled.x() * a.x();
        xy_ += scaled.x() * a.y();
        xz_ += scaled.x() * a.z();
        yy_ += scaled.y() * a.y();
        yz_ += scaled.y() * a.z();
        zz_ += scaled.z() * a.z();
    }
    void scale(double by) {
        for (double* entry : {&xx_, &xy_, &xz_, &yy_, &yz_, &zz_}) *entry *= by;
    }
    Vec3d times(const Vec3d& a) const {
        return {xx_ * a.x() + xy_ * a.y() + xz_ * a.z(), xy_ * a.x() + yy_ * a.y() + yz_ * a.z(),
                xz_ * a.x() + yz_ * a.y() + zz_ * a.z()};
    }

    struct Axes {
        double larger, smaller;
        Vec3d of_larger, of_smaller;  ///< unit, perpendicular to each other and to the normal
    };
    /// Eigenvalues and eigenvectors within the plane of a unit normal.
    Axes axes(const Vec3d& normal) const {
        Eigen::Index least = 0;
        normal.cwiseAbs().minCoeff(&least);
        const Vec3d u = normal.cross(Vec3d::Unit(least)).normalized(), w = normal.cross(u);
        const Vec3d along_u = times(u);
        const double uu = u.dot(along_u), uw = w.dot(along_u), ww = w.dot(times(w));
        const double angle = 0.5 * std::atan2(2 * uw, uu - ww);
        const double half = std::hypot(0.5 * (uu - ww), uw), mean = 0.5 * (uu + ww);
        const double c = std::cos(angle), s = std::sin(angle);
        return {mean + half, mean - half, c * u + s * w, c * w - s * u};
    }

 private:
    double xx_ = 0, xy_ = 0, xz_ = 0, yy_ = 0, yz_ = 0, zz_ = 0;
};

}  // namespace vdbgeo
