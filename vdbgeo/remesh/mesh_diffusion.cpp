#include "vdbgeo/remesh/mesh_diffusion.h"
