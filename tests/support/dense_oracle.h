// The operators of vdbgeo/flow once more, in double precision and without any cleverness: a list of voxels,
// the six neighbours of each, and the sums as they are written. Slow, and meant to be obviously right.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <unordered_map>
#include <vector>

#include "vdbgeo/core/types.h"
#include "vdbgeo/flow/baselines.h"
#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo::test {

/// One number for each active voxel, in the oracle's order.
using Values = std::vector<double>;
/// The fields that move together: one, or two that are coupled.
using State = std::vector<Values>;
using Rate = std::function<State(const State&)>;

class Oracle {
 public:
    static constexpr int none = -1;

    explicit Oracle(const openvdb::FloatGrid& grid, const Vec3d& weights = Vec3d::Ones())
        : weights_(weights) {
        for (auto it = grid.cbeginValueOn(); it; ++it) {
            openvdb::CoordBBox box;
            it.getBoundingBox(box);
            for (auto c = box.begin(); c; ++c) {
                number_.emplace(*c, static_cast<int>(voxels_.size()));
                voxels_.push_back(*c);
                input_.push_back(*it);
            }
        }
        for (const openvdb::Coord& c : voxels_)
            near_.push_back({number(c.offsetBy(-1, 0, 0)), number(c.offsetBy(1, 0, 0)),
                             number(c.offsetBy(0, -1, 0)), number(c.offsetBy(0, 1, 0)),
                             number(c.offsetBy(0, 0, -1)), number(c.offsetBy(0, 0, 1))});
        if (!input_.empty()) {
            const auto [low, high] = std::minmax_element(input_.begin(), input_.end());
            range_ = *high - *low;
        }
    }

    std::size_t size() const { return voxels_.size(); }
    const openvdb::Coord& voxel(std::size_t i) const { return voxels_[i]; }
    /// X, the grid's values.
    const Values& input() const { return input_; }
    /// max X − min X.
    double range() const { return range_; }
    int number(const openvdb::Coord& c) const {
        const auto it = number_.find(c);
        return it == number_.end() ? none : it->second;
    }

    /// L_d w, with d_face the mean of the two voxels' d.
    Values flux(const Values& w, const Values& d) const {
        Values out(size());
        for (std::size_t i = 0; i < size(); ++i)
            for (std::size_t f = 0; f < 6; ++f)
                if (const int n = near_[i][f]; n != none) {
                    const auto m = static_cast<std::size_t>(n);
                    out[i] += weights_[static_cast<int>(f) / 2] * 0.5 * (d[i] + d[m]) * (w[i] - w[m]);
                }
        return out;
    }
    /// L^q u.
    Values power(Values u, int q) const {
        for (; q > 0; --q) u = flux(u, Values(size(), 1.0));
        return u;
    }
    /// Central differences times √w_a, a missing neighbour having the voxel's own value.
    Vec3d gradient(const Values& u, std::size_t i) const {
        const auto at = [&](std::size_t f) {
            return near_[i][f] == none ? u[i] : u[static_cast<std::size_t>(near_[i][f])];
        };
        const Vec3d difference(at(1) - at(0), at(3) - at(2), at(5) - at(4));
        return 0.5 * difference.cwiseProduct(weights_.cwiseSqrt());
    }
    /// d of Eqs 3 and 4.
    Values diffusivity(const Values& u, const DiffusionTerm& term, const EdgeScale& scale) const {
        Values out(size(), term.diffusivity);
        if (scale.kind == EdgeScale::Kind::infinite) return out;
        std::vector<Vec3d> slopes(size()), samples(size());
        for (std::size_t i = 0; i < size(); ++i) {
            slopes[i] = gradient(u, i);
            samples[i] = term.order == 0 ? Vec3d(u[i], 0, 0) : slopes[i];
        }
        const double floor = std::pow(1e-6 * range_, 2);
        const double global = scale.kind == EdgeScale::Kind::global ? variance(samples) : 0;
        for (std::size_t i = 0; i < size(); ++i) {
            double sigma2 = 0;
            if (scale.kind == EdgeScale::Kind::value) sigma2 = scale.value * scale.value;
            if (scale.kind == EdgeScale::Kind::global) sigma2 = scale.factor * scale.factor * global;
            if (scale.kind == EdgeScale::Kind::local)
                sigma2 = scale.factor * scale.factor * variance(window(samples, i, scale.radius));
            sigma2 = std::max(sigma2, floor);
            // Without any variation there is no gradient either.
            if (sigma2 > 0) out[i] *= std::exp(-slopes[i].squaredNorm() / (2 * sigma2));
        }
        return out;
    }
    /// The samples of the active voxels of the (2r+1)³ window.
    template <class T>
    std::vector<T> window(const std::vector<T>& samples, std::size_t i, int r) const {
        std::vector<T> out;
        for (int x = -r; x <= r; ++x)
            for (int y = -r; y <= r; ++y)
                for (int z = -r; z <= r; ++z)
                    if (const int n = number(voxels_[i].offsetBy(x, y, z)); n != none)
                        out.push_back(samples[static_cast<std::size_t>(n)]);
        return out;
    }

    /// −Σ_q L_{d_q} L^q u + β (X − u), coefficients frozen at `start`.
    Rate hyperdiffusion(const std::vector<DiffusionTerm>& terms, const EdgeScale& scale, double fidelity,
                        const State& start) const {
        std::vector<Values> d;
        for (const DiffusionTerm& t : terms) d.push_back(diffusivity(start[0], t, scale));
        return [this, terms, d, fidelity](const State& s) {
            Values out(size());
            for (std::size_t t = 0; t < terms.size(); ++t)
                add(out, -1, flux(power(s[0], terms[t].order), d[t]));
            for (std::size_t i = 0; i < size(); ++i) out[i] += fidelity * (input_[i] - s[0][i]);
            return State{out};
        };
    }
    /// Eqs 6 and 7: two fields, each with its diffusivity and its coupling to the other.
    Rate coupled(int order, const std::array<double, 2>& d0, const std::array<double, 2>& coupling,
                 const EdgeScale& scale, const State& start) const {
        std::array<Values, 2> d;
        for (std::size_t k = 0; k < 2; ++k)
            d[k] = d0[k] > 0 ? diffusivity(start[k], {order, d0[k]}, scale) : Values(size());
        return [this, order, d, coupling](const State& s) {
            State out(2, Values(size()));
            for (std::size_t k = 0; k < 2; ++k) {
                add(out[k], -1, flux(power(s[k], order), d[k]));
                for (std::size_t i = 0; i < size(); ++i) out[k][i] += coupling[k] * (s[1 - k][i] - s[k][i]);
            }
            return out;
        };
    }

    /// Σ g u / Σ g over the active voxels of the (2r+1)³ window, g(dx, dy, dz, u_there − u_here).
    Values weighted_mean(int r, const std::function<double(int, int, int, double)>& g) const {
        Values out(size());
        for (std::size_t i = 0; i < size(); ++i) {
            double sum = 0, norm = 0;
            for (int x = -r; x <= r; ++x)
                for (int y = -r; y <= r; ++y)
                    for (int z = -r; z <= r; ++z) {
                        const int n = number(voxels_[i].offsetBy(x, y, z));
                        if (n == none) continue;
                        const double there = input_[static_cast<std::size_t>(n)];
                        const double w = g(x, y, z, there - input_[i]);
                        sum += w * there;
                        norm += w;
                    }
            out[i] = sum / norm;
        }
        return out;
    }
    Values gaussian(double sigma) const {
        return weighted_mean(static_cast<int>(std::ceil(3 * sigma)), [&](int x, int y, int z, double) {
            return std::exp(-(x * x + y * y + z * z) / (2 * sigma * sigma));
        });
    }
    Values bilateral(const BilateralOptions& o) const {
        return weighted_mean(static_cast<int>(2 * o.sigma), [&](int x, int y, int z, double difference) {
            const double distance2 = x * x + y * y + z * z;
            if (distance2 > 4 * o.sigma * o.sigma) return 0.0;
            return std::exp(-distance2 / (2 * o.sigma * o.sigma) -
                            difference * difference / (2 * o.range * o.range));
        });
    }
    Values median(int r) const {
        Values out(size());
        for (std::size_t i = 0; i < size(); ++i) {
            Values w = window(input_, i, r);
            std::sort(w.begin(), w.end());
            const std::size_t n = w.size();
            out[i] = n % 2 ? w[n / 2] : (w[n / 2 - 1] + w[n / 2]) / 2;
        }
        return out;
    }
    /// 1.4826 median |L u| / √42 over the voxels with all six neighbours; the lower of the middle two.
    double noise() const {
        const Values l = power(input_, 1);
        Values inside;
        for (std::size_t i = 0; i < size(); ++i)
            if (std::find(near_[i].begin(), near_[i].end(), none) == near_[i].end() && l[i] != 0)
                inside.push_back(std::abs(l[i]));
        if (inside.empty()) return 0;
        std::sort(inside.begin(), inside.end());
        return 1.4826 * inside[(inside.size() - 1) / 2] / std::sqrt(42.0);
    }

    /// Population variance, summed over the components.
    static double variance(const std::vector<Vec3d>& samples) {
        Vec3d mean = Vec3d::Zero();
        for (const Vec3d& s : samples) mean += s;
        mean /= static_cast<double>(samples.size());
        double sum = 0;
        for (const Vec3d& s : samples) sum += (s - mean).squaredNorm();
        return sum / static_cast<double>(samples.size());
    }
    static void add(Values& to, double factor, const Values& what) {
        for (std::size_t i = 0; i < to.size(); ++i) to[i] += factor * what[i];
    }

 private:
    Vec3d weights_;
    std::vector<openvdb::Coord> voxels_;
    std::unordered_map<openvdb::Coord, int> number_;
    std::vector<std::array<int, 6>> near_;  // −x +x −y +y −z +z
    Values input_;
    double range_ = 0;
};

/// u + τ A u.
inline State euler_step(State s, double tau, const Rate& rate) {
    const State change = rate(s);
    for (std::size_t k = 0; k < s.size(); ++k) Oracle::add(s[k], tau, change[k]);
    return s;
}

/// n steps of the fast semi-iterative cycle with frozen coefficients.
inline State fsi_cycle(State s, int n, double tau, const Rate& rate) {
    State before = s;
    for (int k = 0; k < n; ++k) {
        const double alpha = (4.0 * k + 2) / (2.0 * k + 3);
        State next = euler_step(s, tau, rate);
        for (std::size_t f = 0; f < s.size(); ++f)
            for (std::size_t i = 0; i < s[f].size(); ++i)
                next[f][i] = alpha * next[f][i] + (1 - alpha) * before[f][i];
        before = std::move(s);
        s = std::move(next);
    }
    return s;
}

/// The largest |grid − expected| over the active voxels.
inline double largest_difference(const openvdb::FloatGrid& grid, const Oracle& oracle,
                                 const Values& expected) {
    double most = 0;
    const auto accessor = grid.getConstAccessor();
    for (std::size_t i = 0; i < oracle.size(); ++i) {
        const double difference = std::abs(accessor.getValue(oracle.voxel(i)) - expected[i]);
        if (!(difference <= most)) most = difference;  // a NaN stays
    }
    return most;
}

}  // namespace vdbgeo::test
