#include "vdbgeo/measure/triangle_tree.h"
