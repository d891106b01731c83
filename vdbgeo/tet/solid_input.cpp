#include "vdbgeo/tet/solid_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/requirements.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/tet/seed_points.h"
#include "vdbgeo/tet/void_sides.h"

namespace vdbgeo {
namespace {

SolidInput solid_input(const TriMesh&, const std::string&, const Progress&) {
    throw NumericalError("not there yet");
}

}  // namespace vdbgeo
