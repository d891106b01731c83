#include "vdbgeo/measure/jet_curvature.h"

namespace vdbgeo {}
