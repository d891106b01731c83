#include "vdbgeo/tet/cutaway.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void CutawayOptions::check() const {}
TriMesh cutaway(const TetMesh&, const CutawayOptions&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
