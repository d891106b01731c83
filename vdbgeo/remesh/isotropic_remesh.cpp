#include "vdbgeo/remesh/isotropic_remesh.h"
