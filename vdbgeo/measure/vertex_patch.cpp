#include "vdbgeo/measure/vertex_patch.h"

namespace vdbgeo {}
