#include "vdbgeo/remesh/half_edge_mesh.h"
