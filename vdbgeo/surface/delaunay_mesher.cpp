#include "vdbgeo/surface/delaunay_mesher.h"
