#include "vdbgeo/remesh/repair.h"
