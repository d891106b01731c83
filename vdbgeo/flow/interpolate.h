// Interpolation of high order in a dense array, with gradient.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

constexpr float not_a_value = std::numeric_limits<float>::quiet_NaN();

/// An array of which voxel (x, y, z) is at data[x · stride_x + y · stride_y + z]; valid for coordinates low …
/// high of each axis. NaN where there is no value: what is interpolated from it comes out as NaN.
struct DenseWindow {
    const float* data;
    std::ptrdiff_t stride_x, stride_y;
    int low[3], high[3];

    const float* at(int x, int y, int z) const { return data + x * stride_x + y * stride_y + z; }
};

struct ValueAndGradient {
    double value = std::numeric_limits<double>::quiet_NaN();
    Vec3d gradient = Vec3d::Zero();
};

namespace detail {

/// Lagrange's weights of N (even) points 1 − N/2 … N/2 for a place t in [0, 1], and their derivatives.
template <int N>
struct LagrangeWeights {
    explicit LagrangeWeights(double t) {
        for (int i = 0; i < N; ++i) {
            double product = 1, slope = 0;
            for (int j = 0; j < N; ++j) {
                if (j == i) continue;
                const double f = 1.0 / (i - j), x = (t - (j + 1 - N / 2)) * f;
                slope = slope * x + product * f;
                product *= x;
            }
            w[i] = product;
            d[i] = slope;
        }
    }
    double w[N], d[N];
};

/// The cell of p, and where in it p is; false where the voxels up to `margin` around it are not in the
/// window.
inline bool find_cell(const DenseWindow& window, const Vec3d& p, int margin, int cell[3], double t[3]) {
    for (int a = 0; a < 3; ++a) {
        if (!(p[a] >= window.low[a] + margin && p[a] < window.high[a] - margin)) return false;
        cell[a] = static_cast<int>(std::floor(p[a]));
        t[a] = p[a] - cell[a];
    }
    return true;
}

}  // namespace detail

/// Value and gradient at p of the polynomial through the N³ voxels around it (Lagrange), of order N. NaN
/// where one lacks a value.
template <int N>
ValueAndGradient lagrange(const DenseWindow& window, const Vec3d& p) {
    ValueAndGradient out;
    int cell[3];
    double t[3];
    if (!detail::find_cell(window, p, N / 2 - 1, cell, t)) return out;
    const detail::LagrangeWeights<N> wx(t[0]), wy(t[1]), wz(t[2]);
    const float* corner = window.at(cell[0] + 1 - N / 2, cell[1] + 1 - N / 2, cell[2] + 1 - N / 2);
    double v = 0, vx = 0, vy = 0, vz = 0;
    for (int i = 0; i < N; ++i) {
        double u = 0, uy = 0, uz = 0;
        for (int j = 0; j < N; ++j) {
            const float* row = corner + i * window.stride_x + j * window.stride_y;
            double s = 0, sz = 0;
            for (int k = 0; k < N; ++k) {
                s += wz.w[k] * row[k];
                sz += wz.d[k] * row[k];
            }
            u += wy.w[j] * s;
            uy += wy.d[j] * s;
            uz += wy.w[j] * sz;
        }
        v += wx.w[i] * u;
        vx += wx.d[i] * u;
        vy += wx.w[i] * uy;
        vz += wx.w[i] * uz;
    }
    out.value = v;
    out.gradient = Vec3d(vx, vy, vz);
    return out;
}

/// The polynomial of order 6, or of order 4 where that lacks a voxel.
inline ValueAndGradient smooth_value(const DenseWindow& window, const Vec3d& p) {
    const ValueAndGradient best = lagrange<6>(window, p);
    return std::isfinite(best.value) ? best : lagrange<4>(window, p);
}

/// Value at p: smooth_value where it has one, else the mean of those of the cell's corners that have one,
/// weighted as in trilinear interpolation; NaN where none has.
inline double interpolate(const DenseWindow& window, const Vec3d& p) {
    const double smooth = smooth_value(window, p).value;
    if (std::isfinite(smooth)) return smooth;
    int cell[3];
    double t[3];
    if (!detail::find_cell(window, p, 0, cell, t)) return smooth;
    double sum = 0, weights = 0;
    for (int c = 0; c < 8; ++c) {
        const int x = c & 1, y = c >> 1 & 1, z = c >> 2;
        const double v = *window.at(cell[0] + x, cell[1] + y, cell[2] + z);
        if (!std::isfinite(v)) continue;
        const double w = (x ? t[0] : 1 - t[0]) * (y ? t[1] : 1 - t[1]) * (z ? t[2] : 1 - t[2]) + 1e-6;
        sum += w * v;
        weights += w;
    }
    return weights > 0 ? sum / weights : smooth;
}

}  // namespace vdbgeo
