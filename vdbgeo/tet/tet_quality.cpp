#include "vdbgeo/tet/tet_quality.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

TetShape tet_shape(const Vec3d&, const Vec3d&, const Vec3d&, const Vec3d&) { throw NumericalError("not there yet"); }
TetQuality measure_tets(const TetMesh&, const Progress&) { throw NumericalError("not there yet"); }
void set_quality_properties(TetMesh&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
