#include "vdbgeo/measure/isovalue_table.h"
