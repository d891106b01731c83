#include "vdbgeo/measure/surface_distance.h"
