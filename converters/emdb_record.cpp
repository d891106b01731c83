#include "converters/emdb_record.h"
