#include "converters/mesh_formats.h"
