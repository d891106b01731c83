// Surfaces whose curvature is known, as meshes: what estimates of curvature are measured against.
#pragma once

#include <vector>

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/measure/curvature.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Patches of surfaces with |k| of up to 1/Å around the origin, as graphs z = f(x, y); the specimen lies
/// below, so that the outward normal points up. Values of k1, k2 are those at the origin.
enum class PatchShape {
    peak,           ///< the unit sphere from outside: 1, 1
    pit,            ///< the unit sphere from inside: −1, −1
    ridge,          ///< the unit cylinder from outside: 1, 0
    valley,         ///< the unit cylinder from inside: 0, −1
    saddle_ridge,   ///< z = −0.4 x² + 0.2 y²: 0.8, −0.4
    saddle_valley,  ///< z = 0.4 x² − 0.2 y²: 0.4, −0.8
    minimal,        ///< the catenoid cosh y = √(x² + z²) at its neck: 1, −1
    torus_outside,  ///< torus of radii 2.6 and 1.3 Å, at its outer equator: 0.77, 0.26
    torus_inside,   ///< the same at its inner equator: 0.77, −0.77
};

const char* name_of(PatchShape shape);  ///< "saddle ridge"

/// A graph z = f(x, y) with its derivatives.
struct GraphPoint {
    double z, fx, fy, fxx, fxy, fyy;
};

/// The shape above (x, y), in Å. Every shape is defined for x² + y² < 0.9.
GraphPoint graph_point(PatchShape shape, double x, double y);

/// A field that is zero on the surface, positive in the specimen, and smooth within 0.5 Å of the surface: the
/// signed distance, but of the saddles f(x, y) − z and of the catenoid cosh y − √(x² + (z + 1)²).
double patch_field(PatchShape shape, const Vec3d& p);

struct AnalyticPatchOptions {
    PatchShape shape = PatchShape::peak;
    double max_edge = 0.1;  ///< Å: the longest edge at a measured vertex
    double radius = 0.2;    ///< Å: vertices with x² + y² ≤ radius² are measured
    int margin = 3;         ///< rings of vertices, at least, between these and the border
    /// 0: the image of a lattice of equilateral triangles, where each vertex has its neighbours in opposite
    /// pairs. Above: vertices are moved within the lattice by up to this part of its edges along x and y, in
    /// a pattern that repeats every three vertices, so that it is the same at every edge length. Below 0.3.
    double jitter = 0;

    void check() const;
};

struct AnalyticPatch {
    TriMesh mesh;
    Curvatures exact;                ///< at all vertices, with directions
    std::vector<VertexId> measured;  ///< vertices within the radius
    double longest_edge = 0;         ///< Å, max_edge to 1e-6 of it, with jitter to 1e-3
};

/// A patch of about (2.3 radius / max_edge + 2 margin)² vertices on a known surface. Points of meshes are
/// 32-bit floats: a vertex off the surface by δ costs the one-ring formulas of the order of δ/e² at edges e,
/// which would hide what they do at edges of 0.01 Å. So of the floats within 1e-5 of an edge (1e-3 with
/// jitter) of a vertex's place those are taken that lie so near to the surface that least is lost: some 1e-11
/// Å off. Throws InvalidInput for options that check() refuses. Cost: up to 20 µs a vertex.
AnalyticPatch analytic_patch(const AnalyticPatchOptions& options);

/// The field of a shape sampled every `spacing` Å (up to 0.1), in a box that reaches six samples beyond the
/// part of a patch within the radius.
DensityMap patch_map(PatchShape shape, double spacing, double radius);

/// Errors of an estimate over the measured vertices: the largest, and the root of the mean square.
struct CurvatureErrors {
    double K_max = 0, K_rms = 0, H_max = 0, H_rms = 0;
};

/// Infinite where a measured vertex has no value.
CurvatureErrors curvature_errors(const AnalyticPatch& patch, const Curvatures& estimate);

/// Exact curvature of a graph at a point, into element v: K and H by the derivatives, principal values and
/// directions from the two fundamental forms; the sign is that of a specimen below.
void set_graph_curvature(Curvatures& curvature, std::size_t v, const GraphPoint& point);

/// A sphere around the origin from the faces of an icosahedron, each cut into frequency² triangles; edges
/// differ by some 20 %. 10 frequency² + 2 vertices, on the sphere to the rounding of floats.
TriMesh geodesic_sphere(double radius, int frequency);

}  // namespace vdbgeo
