#include "vdbgeo/surface/marching_cubes.h"

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/surface_parts.h"

namespace vdbgeo {

void MarchingCubesOptions::check() const {
    if (!std::isfinite(static_cast<float>(isovalue)))
        throw InvalidInput("the isovalue is not a finite number");
}

TriMesh marching_cubes(const DensityMap& map, const MarchingCubesOptions& options, const Progress& progress) {
    options.check();
    SurfacePart all(map, static_cast<float>(options.isovalue), openvdb::CoordBBox::inf(),
                    progress.part(0, 0.5));
    all.number(SurfaceNumbers(all.columns()));
    SurfacePiece piece = all.fill(progress.part(0.5, 1));
    TriMesh mesh;
    mesh.points = std::move(piece.points);
    mesh.triangles = std::move(piece.triangles);
    return mesh;
}

}  // namespace vdbgeo
