#include "vdbgeo/measure/fit_scale.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 12;
constexpr std::size_t most_samples = 512;
constexpr double share = 0.95;    // quantile of the changes that is compared: the worst places count
constexpr double hopeless = 1.5;  // times the best of the degree so far: nothing wider is tried
constexpr double favour = 0.1;    // power of the width by which wider neighbourhoods win a tie
constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double unbounded = std::numeric_limits<double>::infinity();

using Fits = tbb::enumerable_thread_specific<PatchFit>;

struct Estimate {
    double k1 = none, k2 = none;
};

/// Ever wider neighbourhoods of one degree. Rings of degree 4 suit even meshes without noise, whose edges may
/// be longer one way than the other; nothing below 2.4 spacings has points enough in all directions.
const std::vector<std::vector<FitScale>>& ladders() {
    static const std::vector<std::vector<FitScale>> all = {
        {{2, 0, 2.4},
         {2, 0, 3.4},
         {2, 0, 4.8},
         {2, 0, 6.8},
         {2, 0, 9.6},
         {2, 0, 13.6},
         {2, 0, 19},
         {2, 0, 27}},
        {{4, 2, 2}, {4, 3, 3}, {4, 4, 4}},
        {{4, 0, 3.4}, {4, 0, 4.8}, {4, 0, 6.8}, {4, 0, 9.6}, {4, 0, 13.6}}};
    return all;
}

/// Spread over the mesh by steps of the golden section; whole neighbourhoods before those at borders.
std::vector<VertexId> some_vertices(const Array<std::uint8_t>& flags) {
    std::vector<VertexId> out;
    for (const int unwanted : {0xff, int(curvature_undefined)}) {
        for (std::size_t i = 0; i < 4 * most_samples && out.size() < std::min(most_samples, flags.size());
             ++i) {
            const double turns = 0.6180339887498949 * static_cast<double>(i);
            const auto v =
                static_cast<std::size_t>((turns - std::floor(turns)) * static_cast<double>(flags.size()));
            if (!(flags[v] & unwanted)) out.push_back(static_cast<VertexId>(v));
        }
        if (!out.empty()) break;
    }
    return out;
}

std::vector<Estimate> estimates(const ScaledFits& scaled, const std::vector<VertexId>& vertices,
                                const FitScale& scale, Fits& fits) {
    std::vector<Estimate> out(vertices.size());
    parallel_blocks(out.size(), 32, [&](std::size_t begin, std::size_t end) {
        PatchFit& patch = fits.local();
        FittedCurvature k;
        for (std::size_t i = begin; i < end; ++i)
            if (scaled.fit(patch, vertices[i], scale, k)) out[i] = {k.k1, k.k2};
    });
    return out;
}

double quantile(std::vector<double>& values, double q) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// How much the estimates change in proportion to their size; infinite where too few are there.
double relative_change(const std::vector<Estimate>& narrow, const std::vector<Estimate>& wide) {
    std::vector<double> changes, sizes;
    for (std::size_t i = 0; i < wide.size(); ++i) {
        const double change = std::hypot(wide[i].k1 - narrow[i].k1, wide[i].k2 - narrow[i].k2);
        if (!std::isfinite(change)) continue;
        changes.push_back(change);
        sizes.push_back(std::hypot(narrow[i].k1, narrow[i].k2));
    }
    if (changes.empty() || static_cast<double>(changes.size()) < share * static_cast<double>(wide.size()))
        return unbounded;
    const double change = quantile(changes, share), size = quantile(sizes, share);
    return size > 0 ? change / size : 0;
}

}  // namespace

ScaledFits::ScaledFits(const FitSurface& surface, Array<float> spacing)
    : surface_(surface), spacing_(std::move(spacing)) {
    std::vector<double> all;
    for (const float s : spacing_)
        if (s > 0) all.push_back(static_cast<double>(s));
    if (!all.empty()) median_ = quantile(all, 0.5);
}

bool ScaledFits::fit(PatchFit& patch, VertexId v, const FitScale& s, FittedCurvature& out) const {
    return s.rings > 0 ? patch.rings(v, s.rings, s.degree, out) : patch.ball(v, radius(v, s), s.degree, out);
}

bool ScaledFits::fit_anyhow(PatchFit& patch, VertexId v, const FitScale& s, FittedCurvature& out) const {
    for (int degree = s.degree; degree >= 2; degree -= 2) {
        for (const int more : {0, 1, 2})
            if (s.rings > 0 && patch.rings(v, s.rings + more, degree, out)) return true;
        for (const double wider : {1.0, 1.4, 2.0})
            if (s.rings == 0 && patch.ball(v, wider * radius(v, s), degree, out)) return true;
    }
    return patch.rings(v, 2, 2, out) || patch.rings(v, 3, 2, out) || patch.sphere(v, out);
}

ScaledFits::Choice ScaledFits::choose(const Array<std::uint8_t>& flags, double enough, double good) const {
    const std::vector<VertexId> vertices = some_vertices(flags);
    Fits fits([&] { return PatchFit(surface_); });
    Choice best{ladders()[0][0], unbounded, unbounded};
    for (const auto& ladder : ladders()) {
        double least = unbounded;
        std::vector<Estimate> narrow = estimates(*this, vertices, ladder[0], fits);
        for (std::size_t i = 1; i < ladder.size(); ++i) {
            std::vector<Estimate> wide = estimates(*this, vertices, ladder[i], fits);
            const double change = relative_change(narrow, wide);
            const double score = change * std::pow(ladder[i].width, -favour);
            // What changes up to the widest is noise, of which that has least.
            if (score < best.score)
                best = {i + 1 == ladder.size() ? ladder[i] : ladder[i - 1], change, score};
            if (change < enough) return best;
            least = std::min(least, score);
            if (score > hopeless * least) break;
            narrow = std::move(wide);
        }
        if (best.change < good) break;
    }
    return best;
}

Array<float> mesh_spacing(const FitSurface& surface, bool even) {
    const std::size_t count = surface.mesh().points.size();
    const auto edge = [](double area) { return static_cast<float>(std::sqrt(2 / std::sqrt(3.0) * area)); };
    Array<float> areas(count), next(count);
    parallel_for(count, grain, [&](std::size_t v) { areas[v] = surface.area(static_cast<VertexId>(v)); });
    if (even) {
        std::size_t with_area = 0;
        for (const float a : areas) with_area += a > 0;
        const double sum = fixed_order_reduce(
            count, grain, 0.0,
            [&](std::size_t begin, std::size_t end) {
                double part = 0;
                for (std::size_t v = begin; v < end; ++v) part += static_cast<double>(areas[v]);
                return part;
            },
            [](double& to, double part) { to += part; });
        next.assign(count, edge(sum / static_cast<double>(std::max<std::size_t>(1, with_area))));
        return next;
    }
    const VertexNeighbours& n = surface.neighbours();
    // Geometric means: one vertex with huge faces does not widen the neighbourhoods of all around it.
    for (int pass = 0; pass < 4; ++pass) {
        parallel_for(count, grain, [&](std::size_t v) {
            double sum = 0;
            int terms = 0;
            const auto add = [&](float area) {
                if (!(area > 0)) return;
                sum += std::log(static_cast<double>(area));
                ++terms;
            };
            add(areas[v]);
            for (std::uint64_t e = n.begin[v]; e < n.begin[v + 1]; ++e) add(areas[n.neighbours[e]]);
            next[v] = terms ? static_cast<float>(std::exp(sum / terms)) : 0;
        });
        areas.swap(next);
    }
    parallel_for(count, grain, [&](std::size_t v) { next[v] = edge(static_cast<double>(areas[v])); });
    return next;
}

}  // namespace vdbgeo
