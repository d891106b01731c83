#include "vdbgeo/tet/stuffing_lattice.h"

#include <algorithm>
#include <cmath>

namespace vdbgeo::stuffing {
namespace {

/// Every third bit, from the low 21.
std::uint64_t spread(std::uint64_t v) {
    v = (v | v << 32) & 0x1F00000000FFFFull;
    v = (v | v << 16) & 0x1F0000FF0000FFull;
    v = (v | v << 8) & 0x100F00F00F00F00Full;
    v = (v | v << 4) & 0x10C30C30C30C30C3ull;
    return (v | v << 2) & 0x1249249249249249ull;
}

std::uint64_t gather(std::uint64_t v) {
    v &= 0x1249249249249249ull;
    v = (v | v >> 2) & 0x10C30C30C30C30C3ull;
    v = (v | v >> 4) & 0x100F00F00F00F00Full;
    v = (v | v >> 8) & 0x1F0000FF0000FFull;
    v = (v | v >> 16) & 0x1F00000000FFFFull;
    return (v | v >> 32) & 0x1FFFFF;
}

}  // namespace

std::uint64_t key_of(const Coord& block) {
    const auto part = [&](int a) { return spread(static_cast<std::uint64_t>(block[a] + key_bias)); };
    return part(0) << 2 | part(1) << 1 | part(2);
}

Coord block_of(std::uint64_t key) {
    const auto part = [&](int shift) { return static_cast<int>(gather(key >> shift)) - key_bias; };
    return {part(2), part(1), part(0)};
}

Lattice::Lattice(const DensityMap& map, double isovalue, double cell)
    : field_(map, isovalue),
      bounded_(map.frame.bounded()),
      turned_(!bounded_ && map.grid->background() >= static_cast<float>(isovalue)),
      last_((map.frame.size.array() - 1).cast<double>()),
      cell_(cell * map.frame.voxel_size().minCoeff()),
      origin_(map.frame.origin),
      to_index_(cell_ * map.frame.axes.inverse()),
      from_index_(map.frame.axes / cell_) {}

/// How far along `step` (in index units) the box reaches, 0…1: where its border is met, the field jumps
/// there.
double Lattice::leave_box(const Vec3d& in, const Vec3d& step) const {
    double least = 1;
    if (bounded_)
        for (int a = 0; a < 3; ++a) {
            if (in[a] + step[a] > last_[a]) least = std::min(least, (last_[a] - in[a]) / step[a]);
            if (in[a] + step[a] < 0) least = std::min(least, -in[a] / step[a]);
        }
    return std::max(least, 0.0);
}

/// Inverse quadratic interpolation, else the secant, in a bracket that at least every fourth step halves:
/// three or four values where the field is smooth, and an end for any field. Done where the value is 10^-11
/// of what it is at the ends, or the bracket 6·10^-11 of the edge.
double Lattice::root(const Vec3d& in, const Vec3d& out) const {
    constexpr double tolerance = 0x1p-34, relative = 1e-11;
    constexpr int most = 160;
    const Vec3d start = to_index_ * in, step = to_index_ * (out - in);
    const double sign = turned_ ? -1 : 1;
    TrilinearField::Cursor cursor;
    const auto f = [&](double t) { return sign * field_(start + t * step, cursor); };
    double a = 0, fa = f(0), b = 1, fb = f(1);  // f(a) ≥ 0 > f(b)
    if (!(fa > 0)) return 0;
    if (!std::isfinite(fb)) {
        b = leave_box(start, step);
        fb = f(b * (1 - 1e-12));  // rounding must not put the place outside
        if (fb >= 0) return b;
    }
    const double small = relative * (fa - (std::isfinite(fb) ? fb : 0));
    double c = 0, fc = std::numeric_limits<double>::infinity();  // the end that was replaced last
    for (int k = 0; k < most && b - a > tolerance; ++k) {
        double t = 0.5 * (a + b);
        if (k % 4 != 3 && std::isfinite(fa) && std::isfinite(fb)) {
            double s = (a * fb - b * fa) / (fb - fa);
            if (std::isfinite(fc) && fc != fa && fc != fb) {
                const double q = a * fb * fc / ((fa - fb) * (fa - fc)) +
                                 b * fa * fc / ((fb - fa) * (fb - fc)) +
                                 c * fa * fb / ((fc - fa) * (fc - fb));
                if (q > a && q < b) s = q;
            }
            if (s > a && s < b) t = s;
        }
        const double ft = f(t);
        if (std::abs(ft) <= small) return t;
        if (ft > 0) {
            c = a, fc = fa, a = t, fa = ft;
        } else {
            c = b, fc = fb, b = t, fb = ft;
        }
    }
    return 0.5 * (a + b);
}

}  // namespace vdbgeo::stuffing
