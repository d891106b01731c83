#include "vdbgeo/remesh/taubin_smooth.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_neighbours.h"

namespace vdbgeo {
namespace {

double mu_of(const TaubinOptions& options) { return 1 / (options.pass_band - 1 / options.lambda); }

/// to = from + factor · (mean of the neighbours − from) at the vertices that may move.
void step(const VertexNeighbours& around, double factor, const Array<Vec3d>& from, Array<Vec3d>& to) {
    parallel_for(from.size(), 2048, [&](std::size_t v) {
        const std::uint64_t begin = around.begin[v], end = around.begin[v + 1];
        to[v] = from[v];
        if (around.fixed[v] || begin == end) return;
        Vec3d sum = Vec3d::Zero();
        for (std::uint64_t i = begin; i < end; ++i) sum += from[around.neighbours[i]];
        to[v] += factor * (sum / static_cast<double>(end - begin) - from[v]);
    });
}

}  // namespace

void TaubinOptions::check() const {
    if (iterations < 0) throw InvalidInput(fmt::format("smoothing: {} iterations", iterations));
    if (!(lambda > 0 && lambda <= 1))
        throw InvalidInput(fmt::format("smoothing: lambda {} is not above 0 and up to 1", lambda));
    if (!(pass_band > 0 && pass_band < 1 / lambda))
        throw InvalidInput(fmt::format("smoothing: pass band {} is not above 0 and below 1/lambda = {}",
                                       pass_band, 1 / lambda));
    const double fastest = std::abs((1 - 2 * lambda) * (1 - 2 * mu_of(*this)));
    if (!(fastest <= 1))
        throw InvalidInput(
            fmt::format("smoothing: lambda {} with pass band {} makes the fastest waves grow {}-fold", lambda,
                        pass_band, fastest));
}

TriMesh taubin_smooth(const TriMesh& mesh, const TaubinOptions& options, const Progress& progress) {
    options.check();
    check(mesh, "smoothing");
    if (options.iterations == 0 || mesh.empty()) return mesh;
    const VertexNeighbours around(mesh);
    const std::size_t points = mesh.points.size();
    Array<Vec3d> now(points), next(points);
    parallel_for(points, 4096, [&](std::size_t v) { now[v] = mesh.points[v].cast<double>(); });
    for (int i = 0; i < options.iterations; ++i) {
        step(around, options.lambda, now, next);
        step(around, mu_of(options), next, now);
        progress.report(double(i + 1) / options.iterations);
    }
    TriMesh result = mesh;
    parallel_for(points, 4096, [&](std::size_t v) { result.points[v] = now[v].cast<float>(); });
    return result;
}

}  // namespace vdbgeo
