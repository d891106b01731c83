#include "apps/command.h"
