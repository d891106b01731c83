#include "vdbgeo/measure/adaptive_curvature.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/grid_shifts.h"
#include "vdbgeo/measure/patch_fit.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 10;
constexpr std::size_t samples = 512;
// Relative: where estimates agree so well, nothing wider is tried. What is known of a grid's vertices ends there.
constexpr double enough_on_grid = 5e-4, enough_elsewhere = 2e-5;
constexpr double hopeless = 2;      // times the best so far: nothing wider is tried
constexpr double tie = 0.1;         // power of the width by which wider neighbourhoods win
constexpr double share = 0.95;      // quantile of the changes that is compared

/// A neighbourhood to fit and the degree: k rings, or a ball of so many mesh spacings.
struct Scale {
    int degree, rings;
    double width;
};

/// The neighbourhoods of one degree, ever wider.
const std::vector<std::vector<Scale>>& ladders() {
    static const std::vector<std::vector<Scale>> all = {
        {{2, 0, 2.4}, {2, 0, 3.4}, {2, 0, 4.8}, {2, 0, 6.8}, {2, 0, 9.6}, {2, 0, 13.6}, {2, 0, 24}},
        {{4, 2, 2}, {4, 3, 3}, {4, 4, 4}},
        {{4, 0, 3.4}, {4, 0, 4.8}, {4, 0, 6.8}, {4, 0, 9.6}, {4, 0, 13.6}}};
    return all;
}

class AdaptiveFit {
 public:
    AdaptiveFit(const TriMesh& mesh, const Array<std::uint8_t>& flags)
        : mesh_(mesh), flags_(flags), surface_(mesh) {
        const auto lattice = find_sampling_lattice(mesh);
        if (lattice)
            surface_.set_shifts(joins_nodes(mesh, *lattice) ? mask_shifts(surface_, *lattice)
                                                            : interpolation_shifts(surface_, *lattice));
        enough_ = lattice ? enough_on_grid : enough_elsewhere;
        find_spacing(lattice.has_value());
    }

    const FitSurface& surface() const { return surface_; }
    double spacing(VertexId v) const { return spacing_[v]; }
    Scale choose();

    bool fit(PatchFit& patch, VertexId v, const Scale& s, FittedCurvature& out) const {
        return s.rings > 0 ? patch.rings(v, s.rings, s.degree, out)
                           : patch.ball(v, s.width * spacing_[v], s.degree, out);
    }

 private:
    struct Estimate {
        double k1 = std::numeric_limits<double>::quiet_NaN(), k2 = k1;
    };

    void find_spacing(bool even);
    void find_samples();
    std::vector<Estimate> estimates(const Scale& s, tbb::enumerable_thread_specific<PatchFit>& fits) const;

    const TriMesh& mesh_;
    const Array<std::uint8_t>& flags_;
    FitSurface surface_;
    Array<float> spacing_;
    std::vector<VertexId> samples_;
    double enough_;
};

/// The edge of equilateral triangles of which the mesh around would have as many vertices per area.
void AdaptiveFit::find_spacing(bool even) {
    const std::size_t count = mesh_.points.size();
    spacing_.resize(count);
    const auto edge = [](double area) { return static_cast<float>(std::sqrt(2 / std::sqrt(3.0) * area)); };
    if (even) {
        struct Sum {
            double area = 0;
            std::size_t count = 0;
        };
        const Sum sum = fixed_order_reduce(
            count, 1 << 14, Sum{},
            [&](std::size_t begin, std::size_t end) {
                Sum s;
                for (std::size_t v = begin; v < end; ++v)
                    if (const double a = surface_.area(static_cast<VertexId>(v)); a > 0) s.area += a, ++s.count;
                return s;
            },
            [](Sum& to, const Sum& part) { to.area += part.area, to.count += part.count; });
        std::fill(spacing_.begin(), spacing_.end(), edge(sum.area / static_cast<double>(std::max<std::size_t>(1, sum.count))));
        return;
    }
    const VertexNeighbours& n = surface_.neighbours();
    Array<float> areas(count), next(count);
    parallel_for(count, 1 << 12, [&](std::size_t v) { areas[v] = surface_.area(static_cast<VertexId>(v)); });
    for (int pass = 0; pass < 4; ++pass) {
        parallel_for(count, 1 << 12, [&](std::size_t v) {
            double sum = areas[v];
            for (std::uint64_t e = n.begin[v]; e < n.begin[v + 1]; ++e) sum += areas[n.neighbours[e]];
            next[v] = static_cast<float>(sum / static_cast<double>(n.begin[v + 1] - n.begin[v] + 1));
        });
        areas.swap(next);
    }
    parallel_for(count, 1 << 12, [&](std::size_t v) { spacing_[v] = edge(areas[v]); });
}

/// Spread over the mesh by steps of the golden section; those of full neighbourhoods before others.
void AdaptiveFit::find_samples() {
    const std::size_t count = mesh_.points.size();
    for (const std::uint8_t unwanted : {0xff, int(curvature_undefined)}) {
        samples_.clear();
        for (std::size_t i = 0; i < 4 * samples && samples_.size() < std::min(samples, count); ++i) {
            const double turn = 0.6180339887498949 * static_cast<double>(i);
            const auto v = static_cast<std::size_t>((turn - std::floor(turn)) * static_cast<double>(count));
            if (!(flags_[v] & unwanted)) samples_.push_back(static_cast<VertexId>(v));
        }
        if (!samples_.empty()) return;
    }
}

std::vector<AdaptiveFit::Estimate> AdaptiveFit::estimates(
    const Scale& s, tbb::enumerable_thread_specific<PatchFit>& fits) const {
    std::vector<Estimate> out(samples_.size());
    parallel_blocks(out.size(), 32, [&](std::size_t begin, std::size_t end) {
        PatchFit& patch = fits.local();
        FittedCurvature k;
        for (std::size_t i = begin; i < end; ++i)
            if (fit(patch, samples_[i], s, k) && k.degree == s.degree) out[i] = {k.k1, k.k2};
    });
    return out;
}

double quantile(std::vector<double>& values, double q) {
    if (values.empty()) return std::numeric_limits<double>::infinity();
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// The scale whose estimates change least, in proportion, when the neighbourhood grows by √2.
Scale AdaptiveFit::choose() {
    find_samples();
    tbb::enumerable_thread_specific<PatchFit> fits([&] { return PatchFit(surface_); });
    Scale best = ladders()[0][0];
    double least = std::numeric_limits<double>::infinity();
    for (const auto& ladder : ladders()) {
        double least_here = std::numeric_limits<double>::infinity();
        std::vector<Estimate> narrow = estimates(ladder[0], fits);
        for (std::size_t i = 1; i < ladder.size(); ++i) {
            std::vector<Estimate> wide = estimates(ladder[i], fits);
            std::vector<double> changes, sizes;
            for (std::size_t s = 0; s < wide.size(); ++s) {
                const double change = std::hypot(wide[s].k1 - narrow[s].k1, wide[s].k2 - narrow[s].k2);
                if (!std::isfinite(change)) continue;
                changes.push_back(change);
                sizes.push_back(std::hypot(narrow[s].k1, narrow[s].k2));
            }
            if (static_cast<double>(changes.size()) < share * static_cast<double>(samples_.size())) {
                narrow = std::move(wide);
                continue;
            }
            const double size = quantile(sizes, share), change = quantile(changes, share);
            const double relative = size > 0 ? change / size : 0;
            const double score = relative * std::pow(ladder[i].width, -tie);
            if (getenv("ADAPT")) fmt::print("deg {} rings {} width {:.1f}: change {:.2e} size {:.2e} rel {:.2e}\n", ladder[i].degree, ladder[i].rings, ladder[i].width, change, size, relative);
            if (score < least) {
                least = score;
                best = i + 1 == ladder.size() ? ladder[i] : ladder[i - 1];
            }
            least_here = std::min(least_here, score);
            if (relative < enough_) return best;
            if (score > hopeless * least_here) break;
            narrow = std::move(wide);
        }
    }
    return best;
}

}  // namespace

void AdaptiveCurvatureOptions::check() const {
    if (radius && !(*radius > 0 && std::isfinite(*radius)))
        throw InvalidInput(fmt::format("adaptive curvature: radius {} Å is not a length above 0", *radius));
}

AdaptiveCurvature adaptive_curvature(const TriMesh& mesh, const AdaptiveCurvatureOptions& options,
                                     const Progress& progress) {
    options.check();
    AdaptiveCurvature out;
    out.flags = curvature_flags(mesh, "curvature");
    out.resize(mesh.points.size(), true);
    if (mesh.empty()) {
        for (std::size_t v = 0; v < out.size(); ++v) out.set_undefined(v);
        return out;
    }
    progress.report(0.1);
    AdaptiveFit adaptive(mesh, out.flags);
    progress.report(0.3);
    const Scale scale = options.radius ? Scale{2, 0, 0} : adaptive.choose();
    if (getenv("ADAPT")) fmt::print("chosen deg {} rings {} width {:.1f}\n", scale.degree, scale.rings, scale.width);
    progress.report(0.4);
    tbb::enumerable_thread_specific<PatchFit> fits([&] { return PatchFit(adaptive.surface()); });
    std::atomic<std::size_t> done{0};
    parallel_blocks(out.size(), block, [&](std::size_t begin, std::size_t end) {
        PatchFit& patch = fits.local();
        FittedCurvature k;
        for (std::size_t i = begin; i < end; ++i) {
            const auto v = static_cast<VertexId>(i);
            if (!out.defined(i)) {
                out.set_undefined(i);
                continue;
            }
            const bool found = options.radius ? patch.ball(v, *options.radius, 2, k) : adaptive.fit(patch, v, scale, k);
            if (found || patch.rings(v, 2, 2, k) || patch.rings(v, 3, 2, k))
                out.set_from_principal(i, k.k1, k.k2, k.direction1, k.direction2);
            else
                out.set_undefined(i);
        }
        const std::size_t count = done += end - begin;
        progress.report(0.4 + 0.6 * static_cast<double>(count) / static_cast<double>(out.size()));
    });
    progress.report(1);
    return out;
}

}  // namespace vdbgeo
