#include "vdbgeo/remesh/repair.h"

#include <fmt/format.h>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/core/split_non_manifold.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/remesh/fill_holes.h"
#include "vdbgeo/remesh/orient.h"
#include "vdbgeo/remesh/repair_faces.h"
#include "vdbgeo/remesh/untangle.h"

namespace vdbgeo {
namespace {

std::uint64_t remove_degenerate_faces(TriMesh& mesh) {
    std::vector<bool> gone(mesh.triangles.size());
    for (std::size_t f = 0; f < gone.size(); ++f) gone[f] = degenerate(mesh.triangles[f]);
    return remove_faces(mesh, gone);
}

}  // namespace

void RepairOptions::check() const {
    if (fill_holes && max_hole_edges < 3)
        throw InvalidInput(fmt::format(
            "repair: holes of at most {} edges are to be filled, where 3 is the least", max_hole_edges));
}

RepairResult repair(const TriMesh& mesh, const RepairOptions& options, const Progress& progress) {
    options.check();
    check(mesh, "mesh");
    RepairResult result{mesh, {}};
    RepairReport& report = result.report;
    report.merged_vertices = merge_open_edges(result.mesh);
    report.degenerate_faces = remove_degenerate_faces(result.mesh);
    report.duplicate_faces = remove_duplicate_faces(result.mesh);
    progress.report(0.1);
    report.flipped_faces = orient_patches(result.mesh);
    const std::uint64_t max_edges = options.fill_holes ? options.max_hole_edges : 0;
    // Holes that touch in a vertex are filled before the vertex is split; what a split opens, after it.
    for (const bool split : {false, true}) {
        if (split) report.split_vertices = split_non_manifold(result.mesh);
        const FilledHoles holes =
            fill_holes(result.mesh, max_edges, progress.part(split ? 0.2 : 0.1, split ? 0.3 : 0.2));
        report.filled_holes += holes.filled;
        report.open_holes = holes.left_open;
        report.added_faces += holes.faces;
    }
    const OutwardCounts turned = turn_outward(result.mesh);
    report.flipped_faces += turned.faces;
    report.flipped_pieces = turned.pieces;
    if (options.self_intersections && have_self_intersections()) {
        const Untangled cuts = untangle(result.mesh, max_edges, progress.part(0.3, 1));
        report.intersecting_faces_before = cuts.before;
        report.intersecting_faces_after = cuts.after;
        report.moved_vertices = cuts.moved_vertices;
        report.refilled_faces = cuts.refilled_faces;
        report.added_faces += cuts.added_faces;
    }
    report.unused_vertices = remove_unused_vertices(result.mesh) - report.merged_vertices;
    progress.report(1);
    return result;
}

}  // namespace vdbgeo
