#include "vdbgeo/tet/delaunay_tetrahedra.h"

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void DelaunayTetrahedraOptions::check() const {}
bool have_delaunay_tetrahedra() { return false; }
TetMesh delaunay_tetrahedra(const DensityMap&, double, const DelaunayTetrahedraOptions&, const Progress&) { throw NumericalError("not there yet"); }
TetMesh delaunay_tetrahedra_of_labels(const DensityMap&, const std::vector<std::int64_t>&, const DelaunayTetrahedraOptions&, const Progress&) { throw NumericalError("not there yet"); }
TetMesh delaunay_tetrahedra(const TriMesh&, const DelaunayTetrahedraOptions&, const Progress&) { throw NumericalError("not there yet"); }

}  // namespace vdbgeo
