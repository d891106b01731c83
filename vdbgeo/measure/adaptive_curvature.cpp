#include "vdbgeo/measure/adaptive_curvature.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/fit_scale.h"
#include "vdbgeo/measure/grid_shifts.h"
#include "vdbgeo/measure/wide_fits.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 10;

/// Changes, in proportion, at which the search for a scale ends. On grids what is left of their errors is of
/// that size.
constexpr double enough_on_grid = 5e-4, good_on_grid = 1e-3;
constexpr double enough_elsewhere = 2e-5;
/// Above this change a map's noise outweighs the errors of its grid, and undoing these may add to it.
constexpr double noisy = 1e-2;

FitScale chosen_scale(FitSurface& surface, const ScaledFits& fits, const Array<std::uint8_t>& flags,
                      bool on_grid, Array<Vec3f> shifts) {
    if (!on_grid) return fits.choose(flags, enough_elsewhere, enough_elsewhere).scale;
    const auto moved = fits.choose(flags, enough_on_grid, good_on_grid);
    if (shifts.empty() || moved.change < noisy) return moved.scale;
    surface.set_shifts({});
    const auto unmoved = fits.choose(flags, enough_on_grid, good_on_grid);
    if (unmoved.score < moved.score) return unmoved.scale;
    surface.set_shifts(std::move(shifts));
    return moved.scale;
}

void fit_each(const ScaledFits& scaled, const FitScale& scale, Curvatures& out, const Progress& progress) {
    tbb::enumerable_thread_specific<PatchFit> fits([&] { return PatchFit(scaled.surface()); });
    std::atomic<std::size_t> done{0};
    parallel_blocks(out.size(), block, [&](std::size_t begin, std::size_t end) {
        PatchFit& patch = fits.local();
        FittedCurvature k;
        for (std::size_t v = begin; v < end; ++v)
            if (out.defined(v) && scaled.fit_anyhow(patch, static_cast<VertexId>(v), scale, k))
                out.set_from_principal(v, k.k1, k.k2, k.direction1, k.direction2);
            else
                out.set_undefined(v);
        const std::size_t count = done += end - begin;
        progress.report(static_cast<double>(count) / static_cast<double>(out.size()));
    });
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
    progress.report(0.05);
    FitSurface surface(mesh);
    const auto lattice = find_sampling_lattice(mesh);
    Array<Vec3f> shifts;
    if (lattice && joins_nodes(mesh, *lattice)) {
        surface.set_shifts(mask_shifts(surface, *lattice));
    } else if (lattice) {
        shifts = interpolation_shifts(surface, *lattice);
        surface.set_shifts(shifts);
    }
    progress.report(0.3);
    const ScaledFits scaled(surface, mesh_spacing(surface, lattice.has_value()));
    FitScale scale;
    if (options.radius)
        scale = {2, 0, *options.radius, true};
    else
        scale = chosen_scale(surface, scaled, out.flags, lattice.has_value(), std::move(shifts));
    out.radius = scale.radius(scaled.median_spacing());
    progress.report(0.4);

    if (is_wide(scaled, scale))
        fit_by_anchors(scaled, scale, out, progress.part(0.4, 1));
    else
        fit_each(scaled, scale, out, progress.part(0.4, 1));
    progress.report(1);
    return out;
}

}  // namespace vdbgeo
