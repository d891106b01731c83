#include "vdbgeo/tet/netgen_tetrahedra.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void NetgenOptions::check() const {}
bool have_netgen() { return false; }
TetMesh netgen_tetrahedra(const TriMesh&, const NetgenOptions&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
