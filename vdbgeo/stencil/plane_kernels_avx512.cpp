#define VDBGEO_KERNELS avx512
#include "vdbgeo/stencil/plane_kernels_source.h"
