#include "vdbgeo/measure/convex_hull.h"

namespace vdbgeo {}
