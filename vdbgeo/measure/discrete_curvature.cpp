#include "vdbgeo/measure/discrete_curvature.h"

namespace vdbgeo {}
