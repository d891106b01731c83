#include "vdbgeo/tet/tetgen_tetrahedra.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void TetgenOptions::check() const {}
bool have_tetgen() { return false; }
TetMesh tetgen_tetrahedra(const TriMesh&, const TetgenOptions&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
