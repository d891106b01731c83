#include "vdbgeo/measure/adaptive_curvature.h"

namespace vdbgeo {}
