#include "vdbgeo/tet/tetgen_tetrahedra.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/filled_mesh.h"
#include "vdbgeo/tet/isolated.h"
#include "vdbgeo/tet/solid_input.h"

#ifdef VDBGEO_HAS_TETGEN
// TetGen ends by an inline function that frees the mesh and throws a number; on the way out a destructor
// frees it again. The one below takes its place, in the library too: a weak symbol there.
class tetgenmesh;
__attribute__((visibility("default"), noinline)) void terminatetetgen(tetgenmesh*, int code);
#define terminatetetgen terminatetetgen_of_the_header
#include <tetgen.h>
#undef terminatetetgen

void terminatetetgen(tetgenmesh*, int code) { throw code; }
#endif

namespace vdbgeo {
namespace {

constexpr const char* stage = "tetgen";

void require_range(const char* name, double value, double low, double high) {
    if (!(value >= low && value <= high))
        throw InvalidInput(
            fmt::format("{}: the {} is {}, where {} to {} is needed", stage, name, value, low, high));
}

}  // namespace

void TetgenOptions::check() const {
    require_range("largest ratio of circumradius to edge", radius_edge, 1, 100);
    require_range("least dihedral angle", min_dihedral_deg, 0, 18);
    if (max_volume_A3 && !(*max_volume_A3 > 0 && std::isfinite(*max_volume_A3)))
        throw InvalidInput(fmt::format("{}: the largest volume is {} Å³, where more than 0 is needed", stage,
                                       *max_volume_A3));
    if (max_tets == 0) throw InvalidInput("tetgen: no tetrahedra are allowed");
    if (!(max_seconds > 0))
        throw InvalidInput(fmt::format("tetgen: {} s are allowed, where more than 0 is needed", max_seconds));
}

#ifndef VDBGEO_HAS_TETGEN

bool have_tetgen() { return false; }
TetMesh tetgen_tetrahedra(const TriMesh&, const TetgenOptions&, const Progress&) {
    throw NumericalError("not there yet");
}

}  // namespace vdbgeo
