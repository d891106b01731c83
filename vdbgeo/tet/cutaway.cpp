#include "vdbgeo/tet/cutaway.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/tet_adjacency.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/tet/tet_quality.h"

namespace vdbgeo {
namespace {

void CutawayOptions::check() const {}
TriMesh cutaway(const TetMesh&, const CutawayOptions&, const Progress&) {
    throw NumericalError("not there yet");
}

}  // namespace vdbgeo
