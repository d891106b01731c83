#include "vdbgeo/measure/requirements.h"
