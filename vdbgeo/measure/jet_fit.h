// Least-squares polynomials over a tangent plane, and their curvature; no allocation anywhere.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Monomials x^(n−j) y^j of degrees n = 0, 1, … in rows: 1 | x y | x² xy y² | …
constexpr int monomial(int n, int j) { return n * (n + 1) / 2 + j; }
constexpr int monomials_to(int degree) { return monomial(degree + 1, 0); }

/// Solves A x = b in place of b, A symmetric with its lower triangle given, by Cholesky's method on A scaled
/// to a unit diagonal. False where A is singular to `smallest`: a scaled pivot below it.
template <int N>
bool solve_positive(std::array<std::array<double, N>, N>& a, std::array<double, N>& b, double smallest) {
    std::array<double, N> scale;
    for (int i = 0; i < N; ++i) {
        if (!(a[i][i] > 0)) return false;
        scale[i] = 1 / std::sqrt(a[i][i]);
    }
    for (int i = 0; i < N; ++i) {
        b[i] *= scale[i];
        for (int j = 0; j <= i; ++j) {
            double sum = a[i][j] * scale[i] * scale[j];
            for (int k = 0; k < j; ++k) sum -= a[i][k] * a[j][k];
            if (j < i) {
                a[i][j] = sum * a[j][j];
            } else {
                if (!(sum > smallest)) return false;
                a[i][i] = 1 / std::sqrt(sum);
            }
        }
        for (int k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
        b[i] *= a[i][i];
    }
    for (int i = N; i-- > 0;) {
        for (int k = i + 1; k < N; ++k) b[i] -= a[k][i] * b[k];
        b[i] *= a[i][i];
    }
    for (int i = 0; i < N; ++i) b[i] *= scale[i];
    return true;
}

/// The weighted sums of which the normal equations of z = Σ c_nj x^(n−j) y^j are made.
template <int Degree>
class JetSums {
 public:
    static constexpr int unknowns = monomials_to(Degree);
    using Coefficients = std::array<double, unknowns>;

    void clear() {
        powers_.fill(0);
        heights_.fill(0);
    }

    void add(double x, double y, double z, double weight) {
        std::array<double, monomials_to(2 * Degree)> m;
        m[0] = weight;
        for (int n = 1; n <= 2 * Degree; ++n) {
            const int row = monomial(n, 0), before = monomial(n - 1, 0);
            for (int j = 0; j < n; ++j) m[row + j] = m[before + j] * x;
            m[row + n] = m[row - 1] * y;
        }
        for (std::size_t i = 0; i < m.size(); ++i) powers_[i] += m[i];
        for (int i = 0; i < unknowns; ++i) heights_[i] += m[i] * z;
    }

    /// The coefficients by rows of `monomial`; false where the points do not determine them: a scaled pivot
    /// below `smallest`.
    bool solve(Coefficients& c, double smallest = 1e-9) const {
        std::array<std::array<double, unknowns>, unknowns> a;
        for (int n = 0; n <= Degree; ++n)
            for (int j = 0; j <= n; ++j)
                for (int m = 0; m <= n; ++m)
                    for (int i = 0; i <= m; ++i)
                        a[monomial(n, j)][monomial(m, i)] = powers_[monomial(n + m, j + i)];
        c = heights_;
        return solve_positive<unknowns>(a, c, smallest);
    }

 private:
    std::array<double, monomials_to(2 * Degree)> powers_;
    Coefficients heights_;
};

/// Right-handed orthonormal axes, the third given (Duff et al. 2017, JCGT 6(1)).
struct TangentFrame {
    Vec3d x, y, z;

    TangentFrame() = default;
    explicit TangentFrame(const Vec3d& normal) : z(normal) {
        const double sign = std::copysign(1.0, z[2]), a = -1 / (sign + z[2]), b = z[0] * z[1] * a;
        x = {1 + sign * z[0] * z[0] * a, sign * b, -sign * z[0]};
        y = {b, sign + z[1] * z[1] * a, -z[1]};
    }
    Vec3d local(const Vec3d& p) const { return {x.dot(p), y.dot(p), z.dot(p)}; }
    Vec3d world(const Vec3d& p) const { return p[0] * x + p[1] * y + p[2] * z; }
};

/// Principal curvatures and directions of a graph z(x, y) at a point, positive where it bends away from +z.
struct GraphCurvature {
    double first, second;                     ///< first ≥ second
    Vec3d first_direction, second_direction;  ///< unit, in the frame of the graph
    Vec3d normal;

    /// From z's first derivatives p, q and second ones r = z_xx, s = z_xy, t = z_yy.
    GraphCurvature(double p, double q, double r, double s, double t) {
        const double e = 1 + p * p, w = std::sqrt(1 + p * p + q * q);
        normal = Vec3d(-p, -q, 1) / w;
        // Unit tangents: u along (1, 0), v across it; each as a step in (x, y).
        const double ux = 1 / std::sqrt(e), vx = -p * q / (std::sqrt(e) * w), vy = std::sqrt(e) / w;
        const double uu = -r * ux * ux / w, uv = -ux * (r * vx + s * vy) / w,
                     vv = -(r * vx * vx + 2 * s * vx * vy + t * vy * vy) / w;
        const double mean = 0.5 * (uu + vv), half = 0.5 * (uu - vv), root = std::hypot(half, uv);
        first = mean + root;
        second = mean - root;
        const double angle = root > 0 ? 0.5 * std::atan2(uv, half) : 0.0;
        const double c = std::cos(angle), d = std::sin(angle);
        const Vec3d u(ux, 0, ux * p), v(vx, vy, vx * p + vy * q);
        first_direction = c * u + d * v;
        second_direction = c * v - d * u;
    }
};

}  // namespace vdbgeo
