#include "vdbgeo/remesh/taubin_smooth.h"
