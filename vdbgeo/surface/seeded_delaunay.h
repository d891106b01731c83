// Delaunay refinement that misses nothing: seeded from a mesh of the same surface and checked against it.
// Shared by delaunay_surface and delaunay_remesh.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/surface/delaunay_mesher.h"

namespace vdbgeo {

/// A mesh of the surface with its topology; in the solid's coordinates.
struct ReferenceMesh {
    std::vector<Vec3d> points;
    Array<Triangle> triangles;
    /// Points on parts of the surface that the mesh leaves out (where it is open).
    std::vector<Vec3d> extra_seeds;
};

struct SeededBounds {
    double angle_deg = 30;
    double radius = 0;
    double distance = 0;
    std::uint64_t max_vertices = 0;
    double max_seconds = 0;
};

/// The surface of `solid` by DelaunayMesher, seeded on every component of `reference` at about two thirds of
/// the density of the result. Components of less than seven radii across have a smaller radius bound, 0.15 of
/// their size. What came out is compared with the reference, and up to four times seeds are added, the radius
/// bound lowered and the refinement carried on: where a component is missing, where two are one or one is two
/// (there the bound follows the thickness of the necks and gaps, down to 1/64 of the radius bound), and where
/// a vertex of the reference is farther than the radius bound from every vertex of the result. Open
/// components of the reference may be joined with each other. Where components still differ then, missing and
/// small ones are copied from the reference; large ones may stay joined or parted. Throws NumericalError at a
/// cap; Cancelled.
DelaunayMesh seeded_delaunay(const Solid& solid, const Vec3d& low, const Vec3d& high,
                             const ReferenceMesh& reference, const SeededBounds& bounds,
                             const Progress& progress);

}  // namespace vdbgeo
