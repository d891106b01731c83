// Mends what can be mended in a mesh.
#pragma once

#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct RepairOptions {
    bool fill_holes = true;
    std::uint64_t max_hole_edges = 1000;  ///< larger holes stay open
    bool self_intersections = true;       ///< tries to remove them

    void check() const;
};

struct RepairReport {
    std::uint64_t merged_vertices = 0, unused_vertices = 0, degenerate_faces = 0, duplicate_faces = 0,
                  split_vertices = 0, flipped_faces = 0, filled_holes = 0, open_holes = 0,
                  intersecting_faces_before = 0, intersecting_faces_after = 0;
};

struct RepairResult {
    TriMesh mesh;
    RepairReport report;
};

RepairResult repair(const TriMesh& mesh, const RepairOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
