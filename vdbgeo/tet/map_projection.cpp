#include "vdbgeo/tet/map_projection.h"
namespace vdbgeo { SurfaceProjection map_projection(const DensityMap&, double) { return {}; } }
