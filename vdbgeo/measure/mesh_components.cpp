#include "vdbgeo/measure/mesh_components.h"
