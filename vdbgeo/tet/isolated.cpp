#include "vdbgeo/tet/isolated.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

std::vector<std::byte> run_isolated(const std::function<std::vector<std::byte>()>&, const IsolationLimits&, const std::string&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
