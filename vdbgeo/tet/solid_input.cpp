#include "vdbgeo/tet/solid_input.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

SolidInput solid_input(const TriMesh&, const std::string&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
