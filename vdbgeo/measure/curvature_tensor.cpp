#include "vdbgeo/measure/curvature_tensor.h"

namespace vdbgeo {}
