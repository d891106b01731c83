// Meshes of known curvature, of any size, and how far estimates are from it.
#pragma once

#include <optional>
#include <string>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::bench {

/// A sphere (ring = 0) or a torus about z.
struct CurvedShape {
    double ring = 0, radius = 1;
    Vec3d centre = Vec3d::Zero();

    /// k1 ≥ k2 at the point of the shape nearest to p.
    std::pair<double, double> principal(const Vec3d& p) const;
};

/// "sphere:R", "torus:RING,TUBE", either with "@X,Y,Z" behind for the centre.
CurvedShape parse_shape(const std::string& words);

/// A mesh on the shape of about that many faces: an octahedron's faces split evenly, or a grid.
TriMesh make_curved_mesh(const CurvedShape& shape, double faces);

/// Of the mean and the Gaussian curvature, times r and r²; border and undefined vertices left out.
struct CurvatureErrors {
    double mean_rms = 0, mean_max = 0, gauss_rms = 0, gauss_max = 0;
    std::size_t left_out = 0;
};
CurvatureErrors curvature_errors(const CurvedShape& shape, const TriMesh& mesh, const Array<double>& mean,
                                 const Array<double>& gauss, const Array<std::uint8_t>& flags);

}  // namespace vdbgeo::bench
