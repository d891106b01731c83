#include "vdbgeo/measure/gaussian_window.h"

#include <Eigen/Core>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace vdbgeo {
namespace {

/// Half the width of a window in standard deviations: the gaussian has come down to 3e-4 there.
constexpr double reach = 4;

}  // namespace

GaussianWindow::GaussianWindow(double sigma)
    : sigma_(sigma), count_(step * std::max(2, static_cast<int>(std::ceil(2 * reach * sigma / step)))) {
    gaussian_.resize(static_cast<std::size_t>(count_));
    for (int i = 0; i < count_; ++i) {
        const double d = (i + 1 - count_ / 2) / sigma;
        gaussian_[static_cast<std::size_t>(i)] = std::exp(-0.5 * d * d);
    }
    const double end = 0.5 * count_ / sigma;
    floor_ = std::exp(-0.5 * end * end);
}

int GaussianWindow::first(double x) const { return static_cast<int>(std::floor(x)) + 1 - count_ / 2; }

bool GaussianWindow::fill(double x, int low, int high, double* value, double* slope, double* second) const {
    const int first = this->first(x);
    const int begin = std::max(0, low - first), end = std::min(count_, high - first + 1);
    if (end - begin < 3) return false;
    std::fill_n(value, count_, 0.0);
    std::fill_n(slope, count_, 0.0);
    std::fill_n(second, count_, 0.0);
    // exp(−(i − t)²/2σ²) from the table: exp(−i²/2σ²) exp(−t²/2σ²) exp(t/σ²)^i.
    const double t = x - std::floor(x), scale = 1 / sigma_;
    const double ratio = std::exp(t * scale * scale);
    double factor = std::exp(-0.5 * t * t * scale * scale + (begin + 1 - count_ / 2) * t * scale * scale);
    double m[5] = {0, 0, 0, 0, 0};
    for (int i = begin; i < end; ++i, factor *= ratio) {
        const double d = (first + i - x) * scale;
        double g = std::max(0.0, gaussian_[static_cast<std::size_t>(i)] * factor - floor_);
        value[i] = g;
        for (double& sum : m) {
            sum += g;
            g *= d;
        }
    }
    Eigen::Matrix3d moments;
    moments << m[0], m[1], m[2], m[1], m[2], m[3], m[2], m[3], m[4];
    const Eigen::Matrix3d inverse = moments.inverse();
    const Eigen::Vector3d v = inverse.col(0) + inverse.col(2), s = scale * inverse.col(1),
                          c = 2 * scale * scale * inverse.col(2);
    for (int i = begin; i < end; ++i) {
        const double d = (first + i - x) * scale, g = value[i];
        value[i] = g * (v[0] + d * (v[1] + d * v[2]));
        slope[i] = g * (s[0] + d * (s[1] + d * s[2]));
        second[i] = g * (c[0] + d * (c[1] + d * c[2]));
    }
    return true;
}

}  // namespace vdbgeo
