#include "vdbgeo/remesh/simplify.h"
