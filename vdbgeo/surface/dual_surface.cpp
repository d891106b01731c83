#include "vdbgeo/surface/dual_surface.h"
