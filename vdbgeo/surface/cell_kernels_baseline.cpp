#define VDBGEO_KERNELS baseline
#include "vdbgeo/surface/cell_kernels_source.h"
