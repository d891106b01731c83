#include "vdbgeo/tet/tet_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/order_statistic.h"

namespace vdbgeo {
namespace {

TetShape tet_shape(const Vec3d&, const Vec3d&, const Vec3d&, const Vec3d&) {
    throw NumericalError("not there yet");
}
TetQuality measure_tets(const TetMesh&, const Progress&) { throw NumericalError("not there yet"); }
void set_quality_properties(TetMesh&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
