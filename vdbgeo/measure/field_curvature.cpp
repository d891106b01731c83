#include "vdbgeo/measure/field_curvature.h"

namespace vdbgeo {}
