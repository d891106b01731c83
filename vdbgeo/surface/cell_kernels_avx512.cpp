#define VDBGEO_KERNELS avx512
#include "vdbgeo/surface/cell_kernels_source.h"
