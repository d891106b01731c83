#include "vdbgeo/remesh/delaunay_remesh.h"
