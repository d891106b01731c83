// Tetrahedra straight from a map or a segmentation by Delaunay refinement (CGAL's Mesh_3).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/tet/size_field.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The bounds of the paper's §3.4. Lengths are in voxels (the smallest voxel step), for a surface in mean
/// edges of it.
struct DelaunayTetrahedraOptions {
    double facet_angle_deg = 25;          ///< least angle of a boundary triangle; up to 30
    double facet_size = 1.7;              ///< largest radius of a boundary triangle's surface Delaunay ball
    double facet_distance = 0.1;          ///< largest distance from its circumcentre to that ball's centre
    double cell_radius_edge = 2;          ///< largest circumradius over shortest edge of a tetrahedron
    double cell_size = 1.7;               ///< largest circumradius of a tetrahedron
    SizeField size;                       ///< Å; where set it bounds facets and cells too
    bool lloyd = false, odt = false;      ///< global smoothing, before the next two
    bool perturb = false, exude = false;  ///< against slivers
    double sliver_bound_deg = 12;         ///< dihedral angle that perturb and exude try to reach
    /// Faster with several threads, and another mesh each run. Else one thread and the same bytes.
    bool parallel = false;
    std::uint64_t max_vertices = 20'000'000;
    double max_seconds = 3600;

    /// Throws InvalidInput for a value out of range.
    void check() const;
};

/// Whether this build has CGAL.
bool have_delaunay_tetrahedra();

/// Where the trilinear interpolant of the map is at or above `isovalue` (as marching_cubes and
/// TrilinearField take it), by restricted Delaunay refinement (Jamin, Alliez, Yvinec, Boissonnat 2015,
/// doi:10.1145/2699463), closed at the border of the map. Refinement starts from seeds on every piece of the
/// marching-cubes surface, denser on small ones; where a piece or a sheet was missed the seeds are doubled
/// and it goes on (seeded_tetrahedra.h), so that what is missing in the end is thinner than 1/16 of the facet
/// size. All is region 1. With all optimisers off the mesh has slivers, as Delaunay refinement gives them:
/// perturb and exude raise the smallest dihedral angle from near 0° to about 9° or more, at ten times the
/// time; tet_optimize.h is quicker.
///
/// Throws InvalidInput for an option out of range and where this build has no CGAL, NumericalError (a cap,
/// nothing crosses the isovalue), Cancelled. Cost: some 25 µs a tetrahedron on one thread, and 0.8 KB.
TetMesh delaunay_tetrahedra(const DensityMap& map, double isovalue,
                            const DelaunayTetrahedraOptions& options = {}, const Progress& progress = {});

/// All labels of a segmentation above 0 (or those listed), or of a label map cut out of one: one region each,
/// with the label's number; labels that touch share the vertices and faces between them. Which label a place
/// has is told by smoothed indicators (label_domain.h): no staircase, and a voxel keeps its label. Every
/// label has tetrahedra: each of its components is seeded, small ones are meshed finer. Throws InvalidInput
/// for what is no segmentation (is_label_map), or has no such label.
TetMesh delaunay_tetrahedra_of_labels(const DensityMap& labels, const std::vector<std::int64_t>& wanted = {},
                                      const DelaunayTetrahedraOptions& options = {},
                                      const Progress& progress = {});

/// The inside of a closed surface; its triangles are not kept. Sharp edges are rounded off by the facet
/// distance. Lengths are in mean edges of the surface. Throws InvalidInput for a surface that is open or
/// empty.
TetMesh delaunay_tetrahedra(const TriMesh& surface, const DelaunayTetrahedraOptions& options = {},
                            const Progress& progress = {});

}  // namespace vdbgeo
