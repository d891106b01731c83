// How long edges should be at a place, for the tetrahedralizers that grade their meshes.
#pragma once

#include <functional>
#include <optional>

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The length of edges wanted at a place, in Å; above 0. May be called from several threads.
using SizeField = std::function<double(const Vec3d&)>;

struct CurvatureSizeOptions {
    double min_A = 0, max_A = 0;  ///< bounds of the size; both above 0
    /// Edges per full turn of the larger principal curvature: size = 2π / (edges · |κ|max).
    double edges_per_turn = 12;
    double gradation = 0.5;  ///< the size grows by at most this much for each Å of distance from the surface

    void check() const;
};

/// Small where the surface is curved: the size at the nearest vertex of the surface, which has the vertex
/// properties k1 and k2 (command curvature), plus gradation · distance, between the bounds.
SizeField curvature_size(const TriMesh& surface, const CurvatureSizeOptions& options);

struct DensitySizeOptions {
    double min_A = 0, max_A = 0;  ///< the size at `high` and at `low`
    double low = 0, high = 0;     ///< densities; between them the size is linear, outside constant

    void check() const;
};

/// Small where the map is dense, by its trilinear interpolant.
SizeField density_size(const DensityMap& map, const DensitySizeOptions& options);

}  // namespace vdbgeo
