#define VDBGEO_KERNELS avx2
#include "vdbgeo/surface/cell_kernels_source.h"
