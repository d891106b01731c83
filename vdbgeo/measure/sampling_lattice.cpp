#include "vdbgeo/measure/sampling_lattice.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t most_looked_at = 8192;
constexpr std::size_t most_heavy = 64;  // the values that come most often, between which steps are sought
constexpr double on_node = 2e-3;        // of a step
constexpr double least_on_edges = 0.95;
constexpr double least_on_planes = 0.25;  // of the vertices, for a step to be thought of
constexpr double near_best = 0.9;

/// Nodes of one axis.
struct Ticks {
    double origin, step;
    double off(double x) const {
        const double u = (x - origin) / step;
        return std::abs(u - std::round(u));
    }
};

std::vector<double> some_coordinates(const TriMesh& mesh, Eigen::Index axis) {
    std::vector<double> x;
    const std::size_t every = mesh.points.size() / most_looked_at + 1;
    for (std::size_t v = 0; v < mesh.points.size(); v += every)
        x.push_back(static_cast<double>(mesh.points[v][axis]));
    std::sort(x.begin(), x.end());
    return x;
}

/// The values that come most often, most often first; equal ones by rounding are one.
std::vector<double> heavy_values(const std::vector<double>& x, double rounding) {
    std::vector<std::pair<double, std::size_t>> runs;
    for (std::size_t i = 0, j = 0; i < x.size(); i = j) {
        while (j < x.size() && x[j] - x[i] <= rounding) ++j;
        runs.emplace_back(x[i], j - i);
    }
    std::stable_sort(runs.begin(), runs.end(),
                     [](const auto& a, const auto& b) { return a.second > b.second; });
    runs.resize(std::min(runs.size(), most_heavy));
    std::vector<double> heavy;
    for (const auto& run : runs) heavy.push_back(run.first);
    return heavy;
}

/// Distances between neighbours among some values, and halves of them, ascending.
std::vector<double> distances(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    std::vector<double> out;
    for (std::size_t i = 1; i < values.size(); ++i)
        for (const double part : {1.0, 2.0}) out.push_back((values[i] - values[i - 1]) / part);
    std::sort(out.begin(), out.end());
    return out;
}

/// Fits origin and step to the values near nodes, from the first origin outwards: a step that is off by
/// rounding is not lost on the way to the far nodes.
Ticks refined(Ticks ticks, const std::vector<double>& x) {
    const double all = (x.back() - x.front()) / ticks.step;
    for (double range = 8;; range *= 4) {
        double n = 0, q1 = 0, q2 = 0, y1 = 0, qy = 0;
        const double step = ticks.step, origin = ticks.origin;
        for (const double value : x) {
            const double u = (value - origin) / step, q = std::round(u);
            if (std::abs(q) > range || std::abs(u - q) > 10 * on_node) continue;
            const double y = value - origin;
            n += 1, q1 += q, q2 += q * q, y1 += y, qy += q * y;
        }
        const double determinant = n * q2 - q1 * q1;
        if (!(determinant > 0)) return ticks;
        ticks.step = (n * qy - q1 * y1) / determinant;
        ticks.origin += (y1 - ticks.step * q1) / n;
        if (!(ticks.step > 0.9 * step)) return {origin, step};
        if (range > all) return ticks;
    }
}

std::optional<Ticks> axis_ticks(const std::vector<double>& x) {
    const double rounding = 2.5e-7 * std::max(std::abs(x.front()), std::abs(x.back()));
    const std::vector<double> heavy = heavy_values(x, rounding);
    std::optional<Ticks> best;
    double best_share = least_on_planes, last = 0;
    // Of steps that explain about as much, the widest: half a step explains what a step does.
    for (const double step : distances(heavy)) {
        if (step <= 1e3 * rounding || step - last <= 4 * rounding) continue;
        last = step;
        for (std::size_t from = 0; from < heavy.size(); from += from < 3 ? 1 : heavy.size() / 4) {
            const Ticks ticks = refined({heavy[from], step}, x);
            const auto on =
                std::count_if(x.begin(), x.end(), [&](double value) { return ticks.off(value) < on_node; });
            const double share = static_cast<double>(on) / static_cast<double>(x.size());
            if (share < near_best * best_share) continue;
            best = ticks;
            best_share = std::max(best_share, share);
        }
    }
    return best;
}

}  // namespace

LatticePlace SamplingLattice::place(const Vec3f& point) const {
    LatticePlace place;
    double farthest = on_node;
    for (int a = 0; a < 3; ++a) {
        const double u = (static_cast<double>(point[a]) - origin[a]) / step[a], t = u - std::floor(u);
        const double off = std::min(t, 1 - t);
        if (off <= farthest) continue;
        farthest = off;
        place = {a, t * (1 - t) * step[a] * step[a]};
    }
    return place;
}

std::optional<SamplingLattice> find_sampling_lattice(const TriMesh& mesh) {
    if (mesh.points.size() < 16) return std::nullopt;
    SamplingLattice lattice;
    for (int a = 0; a < 3; ++a) {
        const auto ticks = axis_ticks(some_coordinates(mesh, a));
        if (!ticks) return std::nullopt;
        lattice.origin[a] = ticks->origin;
        lattice.step[a] = ticks->step;
    }
    const std::size_t on = fixed_order_reduce(
        mesh.points.size(), 1 << 14, std::size_t{0},
        [&](std::size_t begin, std::size_t end) {
            std::size_t count = 0;
            for (std::size_t v = begin; v < end; ++v) {
                int planes = 0;
                for (int a = 0; a < 3; ++a)
                    planes += Ticks{lattice.origin[a], lattice.step[a]}.off(mesh.points[v][a]) < on_node;
                count += planes >= 2;
            }
            return count;
        },
        [](std::size_t& to, std::size_t part) { to += part; });
    if (static_cast<double>(on) < least_on_edges * static_cast<double>(mesh.points.size()))
        return std::nullopt;
    return lattice;
}

}  // namespace vdbgeo
