#include "vdbgeo/measure/pockets.h"

namespace vdbgeo {}
