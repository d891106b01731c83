// Maximises the least of many smooth functions: how vertices find a better place. For tet_optimize.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace vdbgeo {

/// A function near a place: its value, and how it changes.
template <class Vector>
struct Slope {
    double value;
    Vector gradient;
};

/// The d that maximises min_i (value_i + gradient_i·d) − |d|²/2τ: d = τ Σ λ_i gradient_i, with the λ of the
/// dual (λ ≥ 0, Σ λ = 1) found pair by pair. `predicted` is the minimum there; it is short of the best one by
/// 5 % of the gain at most, or as far as 40 pairs come.
template <class Vector>
Vector model_step(const std::vector<Slope<Vector>>& slopes, double tau, std::vector<double>& lambda,
                  double& predicted) {
    const std::size_t n = slopes.size();
    lambda.assign(n, 0);
    std::size_t low = 0;
    for (std::size_t i = 1; i < n; ++i)
        if (slopes[i].value < slopes[low].value) low = i;
    const double start = slopes[low].value;
    lambda[low] = 1;
    Vector d = tau * slopes[low].gradient;
    for (int pair = 0; pair < 40; ++pair) {
        std::size_t high = n;
        double least = std::numeric_limits<double>::infinity(), most = -least;
        for (std::size_t i = 0; i < n; ++i) {
            const double value = slopes[i].value + slopes[i].gradient.dot(d);
            if (value < least) least = value, low = i;
            if (lambda[i] > 0 && value > most) most = value, high = i;
        }
        predicted = least;
        if (high == n || most - least <= 0.05 * (least - start)) break;
        const Vector apart = slopes[low].gradient - slopes[high].gradient;
        const double square = apart.squaredNorm();
        if (!(square > 0)) break;
        const double shift = std::min(lambda[high], (most - least) / (tau * square));
        lambda[high] -= shift;
        lambda[low] += shift;
        d += tau * shift * apart;
    }
    return d;
}

/// Buffers of ascend, kept from one call to the next.
template <class Vector>
struct AscentBuffers {
    std::vector<Slope<Vector>> slopes;
    std::vector<double> lambda;
};

/// Raises the least function of a problem by a proximal bundle method (Kiwiel 1985, doi:10.1007/BFb0074500):
/// each step is that of the linear model, taken where the true least value rises, and shortened where not.
/// The problem has
///
///   worth(x, floor)      the square of the least function at x, or anything not above `floor` where it is
///   not slopes(x, cut, out)  the functions at x whose value is less than `cut` place(x, d)          where a
///   step d from x leads, if anywhere; it may bend and shorten it size()               the scale of its steps
///
/// Ends where the least function is `enough`, where the model promises less than 0.1 %, and after 10 steps. x
/// and worth are those at the end; whether there was a step.
template <class Vector, class Problem>
bool ascend(Problem& problem, double enough, Vector& x, double& worth, AscentBuffers<Vector>& buffers) {
    constexpr int max_steps = 10, max_trials = 40;
    constexpr double least_gain = 1e-3, wide = 0.7, first_step = 0.2, shortest_step = 1e-4;
    double tau = 0;
    bool moved = false, fresh = true;
    for (int step = 0, trial = 0; step < max_steps && trial < max_trials && worth < enough * enough;
         ++trial) {
        const double value = std::sqrt(worth);
        if (fresh) problem.slopes(x, value + wide, buffers.slopes);
        if (buffers.slopes.empty()) break;
        if (tau == 0) {
            double steepest = 0;
            for (const Slope<Vector>& s : buffers.slopes)
                steepest = std::max(steepest, s.gradient.squaredNorm());
            if (!(steepest > 0)) break;
            tau = first_step * problem.size() / std::sqrt(steepest);
        }
        double predicted = 0;
        const Vector d = model_step(buffers.slopes, tau, buffers.lambda, predicted);
        if (predicted < value * (1 + least_gain) || d.norm() < shortest_step * problem.size()) break;
        const std::optional<Vector> to = problem.place(x, d);
        const double floor = std::max(worth * (1 + 2 * least_gain), 1e-12);
        const double there = to ? problem.worth(*to, floor) : 0;
        fresh = there > floor;
        if (!fresh) {
            tau *= 0.3;
            continue;
        }
        tau *= std::sqrt(there) - value > 0.5 * (predicted - value) ? 1.7 : 0.7;
        x = *to, worth = there, moved = true;
        ++step;
    }
    return moved;
}

}  // namespace vdbgeo
