#include "vdbgeo/measure/vertex_samples.h"

namespace vdbgeo {}
