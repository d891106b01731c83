#include "vdbgeo/tet/isosurface_stuffing.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void StuffingOptions::check() const {}
TetMesh isosurface_stuffing(const DensityMap&, double, const StuffingOptions&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
