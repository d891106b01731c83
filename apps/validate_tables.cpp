#include "apps/validate_tables.h"
