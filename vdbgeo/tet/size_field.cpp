#include "vdbgeo/tet/size_field.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void CurvatureSizeOptions::check() const {}
void DensitySizeOptions::check() const {}
SizeField curvature_size(const TriMesh&, const CurvatureSizeOptions&) { throw NumericalError("not there yet"); }
SizeField density_size(const DensityMap&, const DensitySizeOptions&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
