#define VDBGEO_KERNELS baseline
#include "vdbgeo/stencil/plane_kernels_source.h"
