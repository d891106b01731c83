// Restricted Delaunay refinement of an implicit surface, behind plain functions: no CGAL and no OpenVDB here.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A bounded solid, told by a function. Queries come from one thread.
class Solid {
 public:
    virtual ~Solid() = default;
    /// At or above 0 inside, below it (−∞ is allowed) outside; the nearer to 0, the nearer to the surface.
    virtual double operator()(const Vec3d& p) const = 0;
};

/// What refinement stops at. Lengths are in the unit of the solid's coordinates.
struct DelaunayBounds {
    double angle_deg = 30;
    double radius = 0;
    double distance = 0;
    /// Triangles whose surface ball is smaller are left as they are: at a crease no refinement would end.
    double smallest = 0;
    /// Where set: a smaller radius (and distance) near a place.
    std::function<double(const Vec3d&)> local_radius;
    std::uint64_t max_vertices = 0;
    std::chrono::steady_clock::time_point deadline;
    double max_seconds = 0;  ///< what the deadline was made from, for the message
};

/// A closed surface with normals out of the solid. A point that was given as a seed is told by its number.
struct DelaunayMesh {
    static constexpr std::uint32_t no_seed = 0xFFFFFFFF;
    std::vector<Vec3d> points;
    std::vector<std::uint32_t> seed;  ///< per point
    std::vector<Triangle> triangles;
};

/// Whether this build has CGAL.
bool have_delaunay_mesher();

/// Boissonnat & Oudot 2005 (doi:10.1016/j.gmod.2005.01.004): the facets of the Delaunay triangulation whose
/// dual edges cross the surface, refined until their angles, their surface balls' radii and the distances
/// from their circumcentres to those balls' centres are within the bounds and every vertex has a disc of
/// facets around it (CGAL's Mesh_3, sequential, so that a run repeats to the last bit). The surface is the
/// boundary of the tetrahedra whose circumcentres lie inside: closed, and without self-intersections.
class DelaunayMesher {
 public:
    /// Throws InvalidInput where this build has no CGAL. `low` and `high` hold the solid between them.
    DelaunayMesher(const Solid& solid, const Vec3d& low, const Vec3d& high, const DelaunayBounds& bounds);
    ~DelaunayMesher();

    /// Adds points on the surface, which get the next numbers, and refines. Parts of the surface where no
    /// seed was ever near may be missed. `expected` vertices are 1 for the progress. Throws NumericalError at
    /// a cap.
    void refine(const std::vector<Vec3d>& seeds, double expected, const Progress& progress);

    DelaunayMesh surface() const;

 private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vdbgeo
