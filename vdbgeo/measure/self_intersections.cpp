#include "vdbgeo/measure/self_intersections.h"
