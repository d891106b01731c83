// The worst dihedral angle of a tetrahedron against two bounds, without trigonometry. For tet_optimize.
#pragma once

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Bounds of the dihedral angles, and what an angle θ is worth against them:
///
///   q(θ)² with q(θ) = min( sin(θ/2) / sin(low/2), cos(θ/2) / cos(high/2) )
///
/// by its cosine. It is 1 where an angle is on a bound, more between them and 0 at 0° and at 180°; q is
/// nearly in proportion to an angle that is small, or what lacks one to 180° that is large.
struct DihedralBounds {
    double low_scale, high_scale;

    DihedralBounds(double low_deg, double high_deg)
        : low_scale(1 / (1 - std::cos(low_deg * M_PI / 180))),
          high_scale(1 / (1 + std::cos(high_deg * M_PI / 180))) {}

    /// The least worth among angles, by their least and largest cosine.
    double worth(double least_cosine, double largest_cosine) const {
        return std::min((1 - largest_cosine) * low_scale, (1 + least_cosine) * high_scale);
    }

    /// q of one angle, and how it changes with the cosine.
    struct Value {
        double value, slope;
    };
    Value value(double cosine) const {
        const double low = (1 - cosine) * low_scale, high = (1 + cosine) * high_scale;
        const double q = std::sqrt(std::max(std::min(low, high), 0.0));
        return {q, (low < high ? -low_scale : high_scale) / (2 * q)};
    }
};

/// What the worst dihedral angle of a tetrahedron is worth; 0 for a flat one, −1 for one turned over. By
/// `base`, the unit normal of the face (p, q, r), counter-clockwise seen from outside, with x the corner
/// opposite.
inline double dihedral_worth(const DihedralBounds& bounds, const Vec3d& x, const Vec3d& p, const Vec3d& q,
                             const Vec3d& r, const Vec3d& base) {
    const Vec3d a = p - x, b = q - x, c = r - x;
    const Vec3d np = c.cross(b), nq = a.cross(c), nr = b.cross(a);  // outward, of the faces opposite p, q, r
    const double det = -a.dot(np);
    if (!(det > 0)) return det < 0 ? -1 : 0;
    const double lp = np.squaredNorm(), lq = nq.squaredNorm(), lr = nr.squaredNorm();
    if (!(std::min({lp, lq, lr}) > 0)) return 0;
    const double ip = 1 / std::sqrt(lp), iq = 1 / std::sqrt(lq), ir = 1 / std::sqrt(lr);
    const double u[6] = {np.dot(nq) * ip * iq, nq.dot(nr) * iq * ir, nr.dot(np) * ir * ip,
                         base.dot(np) * ip,    base.dot(nq) * iq,    base.dot(nr) * ir};
    // Outward normals look away from each other where the angle between the faces is small.
    const double least = -std::max({u[0], u[1], u[2], u[3], u[4], u[5]});
    const double largest = -std::min({u[0], u[1], u[2], u[3], u[4], u[5]});
    return bounds.worth(least, largest);
}

/// The same from the four corners, in the order of Tetrahedron.
inline double dihedral_worth(const DihedralBounds& bounds, const Vec3d& a, const Vec3d& b, const Vec3d& c,
                             const Vec3d& d) {
    const Vec3d n = (c - b).cross(d - b);
    const double length = n.norm();
    if (!(length > 0)) return 0;
    return dihedral_worth(bounds, a, b, c, d, n / length);
}

/// The square of circumradius over shortest edge.
inline double radius_edge_squared(const Vec3d& x, const Vec3d& p, const Vec3d& q, const Vec3d& r) {
    const Vec3d a = p - x, b = q - x, c = r - x;
    const double aa = a.squaredNorm(), bb = b.squaredNorm(), cc = c.squaredNorm();
    const Vec3d bc = b.cross(c);
    const double twice_det = 2 * a.dot(bc);
    const double edge =
        std::min({aa, bb, cc, (a - b).squaredNorm(), (b - c).squaredNorm(), (c - a).squaredNorm()});
    const double radius = (aa * bc + bb * c.cross(a) + cc * a.cross(b)).squaredNorm();
    return radius / (twice_det * twice_det * edge);
}

}  // namespace vdbgeo
