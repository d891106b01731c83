#include "apps/command.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::app {

Command tetrahedralize_command() {
    return {"tetrahedralize", "not there yet", "", [](CLI::App&) {
                return [](Session&) { throw NumericalError("not there yet"); };
            }};
}

}  // namespace vdbgeo::app
