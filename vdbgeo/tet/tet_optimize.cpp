#include "vdbgeo/tet/tet_optimize.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void TetOptimizeOptions::check() const {}
TetOptimizeReport optimize_tets(TetMesh&, const TetOptimizeOptions&, const Progress&) {
    throw NumericalError("not there yet");
}

}  // namespace vdbgeo
