// Weighted sums of squared distances to planes: the error measure of edge collapses.
#pragma once

#include <cmath>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// xᵀA x + 2 b·x + c, with x relative to a point that its owner keeps. So centred, the terms stay small
/// wherever the mesh lies, and single precision is enough to store them.
template <class Real>
struct Quadric {
    Real a[6] = {};  ///< xx, xy, xz, yy, yz, zz
    Real b[3] = {};
    Real c = 0;

    /// Adds weight × the squared distance to the plane with unit normal n through the centre.
    void add_plane(const Vec3d& n, double weight) {
        a[0] += static_cast<Real>(weight * n.x() * n.x());
        a[1] += static_cast<Real>(weight * n.x() * n.y());
        a[2] += static_cast<Real>(weight * n.x() * n.z());
        a[3] += static_cast<Real>(weight * n.y() * n.y());
        a[4] += static_cast<Real>(weight * n.y() * n.z());
        a[5] += static_cast<Real>(weight * n.z() * n.z());
    }

    /// Adds weight × the squared distance to the centre.
    void add_centre(double weight) {
        for (const int i : {0, 3, 5}) a[i] += static_cast<Real>(weight);
    }

    Vec3d times(const Vec3d& x) const {
        return {a[0] * x.x() + a[1] * x.y() + a[2] * x.z(), a[1] * x.x() + a[3] * x.y() + a[4] * x.z(),
                a[2] * x.x() + a[4] * x.y() + a[5] * x.z()};
    }
    double trace() const { return double(a[0]) + a[3] + a[5]; }
    Vec3d linear() const { return {double(b[0]), double(b[1]), double(b[2])}; }

    double value(const Vec3d& x) const { return x.dot(times(x) + 2 * linear()) + c; }

    /// Adds another quadric whose centre lies at d.
    template <class Other>
    void add(const Quadric<Other>& other, const Vec3d& d) {
        const Vec3d ad = other.times(d), b_other = other.linear();
        for (int i = 0; i < 6; ++i) a[i] += static_cast<Real>(other.a[i]);
        for (int i = 0; i < 3; ++i) b[i] += static_cast<Real>(b_other[i] - ad[i]);
        c += static_cast<Real>(d.dot(ad) - 2 * b_other.dot(d) + other.c);
    }

    /// The point of least value; false where the matrix is singular to rounding.
    bool minimum(Vec3d& x) const {
        const double xx = a[3] * double(a[5]) - a[4] * double(a[4]),
                     xy = a[2] * double(a[4]) - a[1] * double(a[5]),
                     xz = a[1] * double(a[4]) - a[2] * double(a[3]);
        const double determinant = a[0] * xx + a[1] * xy + a[2] * xz;
        if (!(determinant > 1e-10 * trace() * trace() * trace())) return false;
        const double yy = a[0] * double(a[5]) - a[2] * double(a[2]),
                     yz = a[1] * double(a[2]) - a[0] * double(a[4]),
                     zz = a[0] * double(a[3]) - a[1] * double(a[1]);
        const double scale = -1 / determinant;
        x = Vec3d(xx * b[0] + xy * b[1] + xz * b[2], xy * b[0] + yy * b[1] + yz * b[2],
                  xz * b[0] + yz * b[1] + zz * b[2]) *
            scale;
        return true;
    }
};

}  // namespace vdbgeo
