#include "vdbgeo/remesh/simplify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/surface_distance.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/remesh/edge_collapse.h"

namespace vdbgeo {
namespace {

/// How often the bound on single collapses is lowered before the input comes back as it is.
constexpr int most_attempts = 10;

TriMesh collapsed(const TriMesh& mesh, std::uint64_t faces, const EdgeCollapse::Allowed& allowed,
                  const Progress& progress) {
    EdgeCollapse collapse(mesh, "simplify");
    if (collapse.faces_left() <= faces) return mesh;
    collapse.run(faces, allowed, progress);
    return collapse.mesh(mesh);
}

/// Whether what a collapse makes lies within the reach of the input, by samples.
bool within(const TriangleTree& tree, double reach, const EdgeCollapse::Proposal& proposal) {
    const double squared_reach = reach * reach;
    // The mean over no more than 100 planes, say: then none of them is further than half of the reach.
    if (proposal.error < squared_reach / 400) return true;
    const auto near = [&](const Vec3d& p) {
        return std::isfinite(tree.nearest(p, squared_reach).squared_distance);
    };
    const Vec3d centre = proposal.centre.cast<double>();
    if (!near(centre)) return false;
    return std::all_of(proposal.fan.begin(), proposal.fan.end(), [&](const auto& side) {
        const Vec3d a = side.first.template cast<double>(), b = side.second.template cast<double>();
        return near((centre + a + b) / 3) && near((centre + a) / 2) && near((centre + b) / 2);
    });
}

TriMesh collapsed_within(const TriMesh& mesh, std::uint64_t faces, double max_distance,
                         const Progress& progress) {
    double reach = max_distance;
    for (int attempt = 0; attempt < most_attempts; ++attempt) {
        const double from = 1 - std::pow(0.5, attempt), to = 1 - std::pow(0.5, attempt + 1);
        TriMesh result;
        {
            const TriangleTree tree(mesh);
            result = collapsed(
                mesh, faces, [&](const EdgeCollapse::Proposal& p) { return within(tree, reach, p); },
                progress.part(from, (from + to) / 2));
        }
        if (result.triangles.size() == mesh.triangles.size()) break;
        const double measured =
            surface_distance(result, mesh, {}, progress.part((from + to) / 2, to)).hausdorff;
        if (measured <= max_distance) return result;
        reach *= std::clamp(0.95 * max_distance / measured, 0.5, 0.9);
    }
    return mesh;
}

}  // namespace

void SimplifyOptions::check() const {
    if (!faces && !max_distance)
        throw InvalidInput("simplify: neither a number of faces nor a largest distance is set");
    if (max_distance && !(std::isfinite(*max_distance) && *max_distance > 0))
        throw InvalidInput(
            fmt::format("simplify: largest distance {} A where a number above 0 is needed", *max_distance));
}

TriMesh simplify(const TriMesh& mesh, const SimplifyOptions& options, const Progress& progress) {
    options.check();
    if (mesh.empty()) return mesh;
    const std::uint64_t faces = options.faces.value_or(0);
    if (!options.max_distance) return collapsed(mesh, faces, {}, progress);
    TriMesh result = collapsed_within(mesh, faces, *options.max_distance, progress);
    progress.report(1);
    return result;
}

}  // namespace vdbgeo
