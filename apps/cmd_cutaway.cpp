#include "apps/command.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {

Command cutaway_command() {
    return {"cutaway", "not there yet", "", [](CLI::App&) {
                return [](Session&) { throw NumericalError("not there yet"); };
            }};
}

}  // namespace vdbgeo::app
