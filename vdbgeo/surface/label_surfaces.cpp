#include "vdbgeo/surface/label_surfaces.h"
