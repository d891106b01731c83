#pragma once
#include "vdbgeo/tet/tet_optimize.h"
#include "vdbgeo/volume/density_map.h"
namespace vdbgeo {
SurfaceProjection map_projection(const DensityMap& map, double isovalue);
}
