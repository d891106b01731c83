#include "vdbgeo/surface/trilinear_field.h"
