#include "vdbgeo/volume/power_spectrum.h"

#include <fmt/format.h>
#include <unsupported/Eigen/FFT>

#include <algorithm>
#include <cmath>
#include <complex>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using Complex = std::complex<float>;
constexpr double pi = 3.14159265358979323846;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// The largest product of 2, 3 and 5 that is not above n.
int smooth_length(int n) {
    for (int m = n; m > 1; --m) {
        int rest = m;
        for (const int prime : {2, 3, 5})
            while (rest % prime == 0) rest /= prime;
        if (rest == 1) return m;
    }
    return 1;
}

std::vector<double> window(int n, double taper) {
    std::vector<double> w(index(n), 1.0);
    const double edge = taper * n;
    for (int i = 0; i < n; ++i) {
        const double inside = std::min(i, n - 1 - i) + 0.5;  // from the nearer end
        if (n > 1 && inside < edge) w[index(i)] = 0.5 - 0.5 * std::cos(pi * inside / edge);
    }
    return w;
}

/// The box in the middle, its samples and then their transform: lines along x of `columns` complex numbers,
/// of which each holds two real samples before the transform along x.
class Box {
 public:
    Box(const DensityMap& map, const PowerSpectrumOptions& options) : map_(map) {
        openvdb::Coord low(0, 0, 0);
        Vec3i size = map.frame.size;
        if (!map.frame.bounded()) {
            const auto box = map.grid->evalActiveVoxelBoundingBox();
            low = box.min();
            size = Vec3i::Zero();
            if (!box.empty()) size = Vec3i(box.dim().x(), box.dim().y(), box.dim().z());
        }
        for (int a = 0; a < 3; ++a) {
            n_[a] = smooth_length(std::min(size[a], options.largest));
            origin_[a] = low[a] + (size[a] - n_[a]) / 2;
            window_[index(a)] = window(n_[a], options.taper);
        }
        empty_ = size.minCoeff() < 1 || n_.maxCoeff() < 2;
        columns_ = index(n_.x() / 2 + 1);
    }

    bool empty() const { return empty_; }
    PowerSpectrum spectrum(const Progress& progress);

 private:
    struct Sums {
        double weights = 0, values = 0;
    };
    struct Shells {
        std::vector<double> power;
        std::vector<std::uint64_t> count;
    };

    float* samples(int y, int z) { return reinterpret_cast<float*>(line(y, z)); }
    Complex* line(int y, int z) { return data_.data() + (index(z) * index(n_.y()) + index(y)) * columns_; }
    double weight(int y, int z) const { return window_[1][index(y)] * window_[2][index(z)]; }

    double load();
    void transform_x(double mean);
    void transform_y(const Progress& progress);
    Shells transform_z(const Progress& progress);
    void add(const Complex& value, int kx, int ky, int kz, Shells& shells) const;
    double squared_weights() const;
    void set_scale();

    const DensityMap& map_;
    bool empty_ = true;
    Vec3i n_ = Vec3i::Zero();
    openvdb::Coord origin_;
    std::array<std::vector<double>, 3> window_;
    std::size_t columns_ = 0;
    Array<Complex> data_;
    Mat3d reciprocal_;  // column a: the frequency of one period along axis a of the box, 1/Å
    double width_ = 0;  // of a shell, 1/Å
    std::size_t shells_ = 0;
};

/// Takes the samples from the grid; their weighted mean.
double Box::load() {
    data_.resize(columns_ * index(n_.y()) * index(n_.z()));
    const Sums sums = fixed_order_reduce(
        index(n_.z()), 1, Sums(),
        [&](std::size_t first, std::size_t) {
            const int z = static_cast<int>(first);
            const auto accessor = map_.grid->getConstUnsafeAccessor();
            Sums s;
            for (int y = 0; y < n_.y(); ++y) {
                float* out = samples(y, z);
                double weights = 0, values = 0;
                for (int x = 0; x < n_.x(); ++x) {
                    out[x] = accessor.getValue(origin_.offsetBy(x, y, z));
                    if (!std::isfinite(out[x])) continue;
                    weights += window_[0][index(x)];
                    values += window_[0][index(x)] * double(out[x]);
                }
                s.weights += weight(y, z) * weights;
                s.values += weight(y, z) * values;
            }
            return s;
        },
        [](Sums& all, const Sums& part) {
            all.weights += part.weights;
            all.values += part.values;
        });
    return sums.weights > 0 ? sums.values / sums.weights : 0;
}

void Box::transform_x(double mean) {
    parallel_for(index(n_.z()), 1, [&](std::size_t at) {
        const int z = static_cast<int>(at);
        Eigen::FFT<float> fft;
        fft.SetFlag(Eigen::FFT<float>::HalfSpectrum);
        std::vector<float> in(index(n_.x()));
        for (int y = 0; y < n_.y(); ++y) {
            const float* from = samples(y, z);
            for (int x = 0; x < n_.x(); ++x) {
                const double v = std::isfinite(from[x]) ? double(from[x]) - mean : 0;
                in[index(x)] = static_cast<float>(v * window_[0][index(x)] * weight(y, z));
            }
            if (n_.x() > 1)
                fft.fwd(line(y, z), in.data(), n_.x());
            else
                *line(y, z) = in[0];
        }
    });
}

/// Columns of the line that are transformed together: a cache line of them.
constexpr std::size_t together = 8;

void Box::transform_y(const Progress& progress) {
    const std::size_t n = index(n_.y());
    if (n < 2) return;
    parallel_for(index(n_.z()), 1, [&](std::size_t z) {
        Eigen::FFT<float> fft;
        std::vector<Complex> in(together * n), out(n);
        for (std::size_t kx = 0; kx < columns_; kx += together) {
            const std::size_t some = std::min(together, columns_ - kx);
            for (std::size_t y = 0; y < n; ++y)
                for (std::size_t c = 0; c < some; ++c)
                    in[c * n + y] = line(static_cast<int>(y), static_cast<int>(z))[kx + c];
            for (std::size_t c = 0; c < some; ++c) {
                fft.fwd(out.data(), in.data() + c * n, n_.y());
                std::copy(out.begin(), out.end(), in.begin() + static_cast<std::ptrdiff_t>(c * n));
            }
            for (std::size_t y = 0; y < n; ++y)
                for (std::size_t c = 0; c < some; ++c)
                    line(static_cast<int>(y), static_cast<int>(z))[kx + c] = in[c * n + y];
        }
        progress.report(0.2 + 0.3 * static_cast<double>(z) / n_.z());
    });
}

/// Puts one coefficient, and the conjugate one that is not stored, into its shell.
void Box::add(const Complex& value, int kx, int ky, int kz, Shells& shells) const {
    const Vec3d f =
        reciprocal_ * Vec3d(kx, ky > n_.y() / 2 ? ky - n_.y() : ky, kz > n_.z() / 2 ? kz - n_.z() : kz);
    const auto shell = static_cast<std::size_t>(std::lround(f.norm() / width_));
    if (shell < 1 || shell > shells_) return;
    const int twice = kx > 0 && 2 * kx < n_.x() ? 2 : 1;
    shells.power[shell - 1] += twice * double(std::norm(value));
    shells.count[shell - 1] += static_cast<std::uint64_t>(twice);
}

Box::Shells Box::transform_z(const Progress& progress) {
    const std::size_t n = index(n_.z());
    const Shells none{std::vector<double>(shells_), std::vector<std::uint64_t>(shells_)};
    return fixed_order_reduce(
        index(n_.y()), 1, none,
        [&](std::size_t y, std::size_t) {
            Eigen::FFT<float> fft;
            Shells shells = none;
            std::vector<Complex> in(together * n), out(n);
            for (std::size_t kx = 0; kx < columns_; kx += together) {
                const std::size_t some = std::min(together, columns_ - kx);
                for (std::size_t z = 0; z < n; ++z)
                    for (std::size_t c = 0; c < some; ++c)
                        in[c * n + z] = line(static_cast<int>(y), static_cast<int>(z))[kx + c];
                for (std::size_t c = 0; c < some; ++c) {
                    if (n > 1)
                        fft.fwd(out.data(), in.data() + c * n, n_.z());
                    else
                        out[0] = in[c];
                    for (std::size_t z = 0; z < n; ++z)
                        add(out[z], static_cast<int>(kx + c), static_cast<int>(y), static_cast<int>(z),
                            shells);
                }
            }
            progress.report(0.5 + 0.5 * static_cast<double>(y) / n_.y());
            return shells;
        },
        [](Shells& all, const Shells& part) {
            for (std::size_t i = 0; i < all.power.size(); ++i) {
                all.power[i] += part.power[i];
                all.count[i] += part.count[i];
            }
        });
}

double Box::squared_weights() const {
    double product = 1;
    for (const std::vector<double>& w : window_) {
        double sum = 0;
        for (const double x : w) sum += x * x;
        product *= sum;
    }
    return product;
}

/// Shells as wide as the lowest frequency, up to the lowest Nyquist frequency, of the axes that have more
/// than one sample.
void Box::set_scale() {
    reciprocal_ = map_.frame.axes.inverse().transpose();
    double nyquist = std::numeric_limits<double>::infinity();
    width_ = nyquist;
    for (int a = 0; a < 3; ++a) {
        if (n_[a] > 1) {
            nyquist = std::min(nyquist, 0.5 * reciprocal_.col(a).norm());
            width_ = std::min(width_, reciprocal_.col(a).norm() / n_[a]);
        }
        reciprocal_.col(a) /= n_[a];
    }
    shells_ = static_cast<std::size_t>(nyquist / width_ + 1e-6);
}

PowerSpectrum Box::spectrum(const Progress& progress) {
    set_scale();
    const double mean = load();
    progress.report(0.1);
    transform_x(mean);
    progress.report(0.2);
    transform_y(progress);
    const Shells shells = transform_z(progress);
    progress.report(1);
    const double norm = squared_weights();
    PowerSpectrum result;
    for (std::size_t i = 0; i < shells_; ++i) {
        if (shells.count[i] == 0) continue;
        result.frequency.push_back(static_cast<double>(i + 1) * width_);
        result.power.push_back(shells.power[i] / (static_cast<double>(shells.count[i]) * norm));
        result.count.push_back(shells.count[i]);
    }
    return result;
}

}  // namespace

void PowerSpectrumOptions::check() const {
    if (largest < 2 || largest > 2048)
        throw InvalidInput(
            fmt::format("a power spectrum of {} samples an axis is not in 2 to 2048", largest));
    if (!(taper >= 0 && taper <= 0.5))
        throw InvalidInput(fmt::format("a taper of {} is not in 0 to 0.5", taper));
}

PowerSpectrum power_spectrum(const DensityMap& map, const PowerSpectrumOptions& options,
                             const Progress& progress) {
    options.check();
    Box box(map, options);
    return box.empty() ? PowerSpectrum() : box.spectrum(progress);
}

}  // namespace vdbgeo
