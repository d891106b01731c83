#include "vdbgeo/measure/jet_curvature.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <atomic>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/fit_surface.h"
#include "vdbgeo/measure/jet_fit.h"
#include "vdbgeo/measure/vertex_patch.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 11;
constexpr int most_rings = 64;
constexpr int rings_more = 3;  // how far the search for points goes on where there are too few

class JetFitter {
 public:
    JetFitter(const FitSurface& surface, const JetOptions& options)
        : surface_(surface), options_(options), patch_(surface.mesh(), surface.neighbours()) {}

    /// Puts the curvature of v in its place; undefined where nothing fits.
    void fit(VertexId v, Curvatures& out) {
        if (!(surface_.normal(v).squaredNorm() > 0)) return out.set_undefined(v);
        frame_ = TangentFrame(surface_.normal(v).cast<double>().normalized());
        bool found = fit_members(
            v, options_.radius ? patch_.ball(v, *options_.radius) : patch_.rings(v, options_.rings), out);
        const int rings = options_.radius ? 1 : options_.rings;
        for (int more = 1; more <= rings_more && !found; ++more)
            found = fit_members(v, patch_.rings(v, rings + more), out);
        if (!found) out.set_undefined(v);
    }

 private:
    using Members = std::vector<VertexPatch::Member>;

    bool fit_members(VertexId v, const Members& members, Curvatures& out) {
        local_.clear();
        const Vec3d centre = surface_.point(v);
        double reach = 0;
        for (const auto& m : members) {
            local_.push_back(frame_.local(surface_.point(m.vertex) - centre));
            reach = std::max(reach, local_.back().head<2>().squaredNorm());
        }
        if (!(reach > 0)) return false;
        // Coordinates of about 1 keep the normal equations well conditioned.
        const double scale = 1 / std::sqrt(reach);
        for (Vec3d& p : local_) p *= scale;
        return (options_.degree == 4 && fit_degree<4>(v, scale, out)) ||
               (options_.degree >= 3 && fit_degree<3>(v, scale, out)) || fit_degree<2>(v, scale, out);
    }

    template <int Degree>
    bool fit_degree(VertexId v, double scale, Curvatures& out) const {
        if (local_.size() < JetSums<Degree>::unknowns) return false;
        JetSums<Degree> sums;
        sums.clear();
        for (const Vec3d& p : local_) sums.add(p[0], p[1], p[2], 1);
        typename JetSums<Degree>::Coefficients c;
        if (!sums.solve(c)) return false;
        const GraphCurvature k(c[1], c[2], 2 * c[3], c[4], 2 * c[5]);
        out.set_from_principal(v, scale * k.first, scale * k.second, frame_.world(k.first_direction),
                               frame_.world(k.second_direction));
        return true;
    }

    const FitSurface& surface_;
    const JetOptions& options_;
    VertexPatch patch_;
    TangentFrame frame_;
    std::vector<Vec3d> local_;  // the points in the frame, scaled
};

}  // namespace

void JetOptions::check() const {
    if (degree < 2 || degree > 4)
        throw InvalidInput(fmt::format("jet curvature: degree {} is not 2, 3 or 4", degree));
    if (rings < 1 || rings > most_rings)
        throw InvalidInput(fmt::format("jet curvature: {} rings are not 1 to {}", rings, most_rings));
    if (radius && !(*radius > 0 && std::isfinite(*radius)))
        throw InvalidInput(fmt::format("jet curvature: radius {} Å is not a length above 0", *radius));
}

Curvatures jet_curvature(const TriMesh& mesh, const JetOptions& options, const Progress& progress) {
    options.check();
    Curvatures out;
    out.flags = curvature_flags(mesh, "curvature");
    out.resize(mesh.points.size(), true);
    progress.report(0.1);
    const FitSurface surface(mesh);
    progress.report(0.2);
    tbb::enumerable_thread_specific<JetFitter> fitters([&] { return JetFitter(surface, options); });
    std::atomic<std::size_t> done{0};
    parallel_blocks(out.size(), block, [&](std::size_t begin, std::size_t end) {
        JetFitter& fitter = fitters.local();
        for (std::size_t v = begin; v < end; ++v)
            if (out.defined(v))
                fitter.fit(static_cast<VertexId>(v), out);
            else
                out.set_undefined(v);
        const std::size_t count = done += end - begin;
        progress.report(0.2 + 0.8 * static_cast<double>(count) / static_cast<double>(out.size()));
    });
    progress.report(1);
    return out;
}

}  // namespace vdbgeo
