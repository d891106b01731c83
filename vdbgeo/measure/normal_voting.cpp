#include "vdbgeo/measure/normal_voting.h"

namespace vdbgeo {}
