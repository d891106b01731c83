#include "vdbgeo/core/split_non_manifold.h"
