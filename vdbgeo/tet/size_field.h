// How long edges should be at a place, for the tetrahedralizers that grade their meshes.
#pragma once

#include <functional>

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

/// Small where the surface is curved. The surface has the vertex properties k1 and k2 (command curvature).
/// The size of a vertex is 2π / (edges_per_turn · max(|k1|, |k2|)) between the bounds, and at most that of a
/// neighbour plus gradation · the length of the edge between (so that a small size spreads; as in Borouchaki,
/// Hecht & Frey 1998, doi:10.1002/(SICI)1097-0207(19981130)43:6<1143::AID-NME470>3.0.CO;2-I). The size at a
/// place is that at the nearest point of the surface, linear within its face, plus gradation · distance, at
/// most max_A. Curvatures that are no numbers count as none.
///
/// Cost: that of a TriangleTree and O(n log n); a query about 1 µs. Throws InvalidInput for options out of
/// range, an empty mesh, and one without k1 and k2.
SizeField curvature_size(const TriMesh& surface, const CurvatureSizeOptions& options);

struct DensitySizeOptions {
    double min_A = 0, max_A = 0;  ///< the size at `high` and at `low`
    double low = 0, high = 0;     ///< densities; between them the size is linear, outside constant

    void check() const;
};

/// Small where the map is dense, by its trilinear interpolant. Outside the box of a bounded map the density
/// is that at the nearest place of the box; samples that are not a number count as `low`. The map's grid is
/// kept, and must not change. Cost: a query some 0.3 µs. Throws InvalidInput for options out of range.
SizeField density_size(const DensityMap& map, const DensitySizeOptions& options);

}  // namespace vdbgeo
