#define VDBGEO_KERNELS avx2
#include "vdbgeo/stencil/plane_kernels_source.h"
