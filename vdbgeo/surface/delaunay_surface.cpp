#include "vdbgeo/surface/delaunay_surface.h"
