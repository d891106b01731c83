#include "vdbgeo/surface/cap.h"
