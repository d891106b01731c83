#include "vdbgeo/tet/netgen_tetrahedra.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <exception>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/tet/filled_mesh.h"
#include "vdbgeo/tet/isolated.h"
#include "vdbgeo/tet/solid_input.h"

#ifdef VDBGEO_HAS_NETGEN
namespace nglib {
#include <nglib.h>
}
#endif

namespace vdbgeo {
namespace {

constexpr const char* stage = "netgen";

}  // namespace

void NetgenOptions::check() const {
    if (max_edge_A && !(*max_edge_A > 0 && std::isfinite(*max_edge_A)))
        throw InvalidInput(
            fmt::format("{}: the longest edge is {} Å, where more than 0 is needed", stage, *max_edge_A));
    if (!(grading >= 0 && grading <= 1))
        throw InvalidInput(fmt::format("{}: the grading is {}, where 0 to 1 is needed", stage, grading));
    if (optimisation_rounds < 0 || optimisation_rounds > 20)
        throw InvalidInput(fmt::format("{}: {} rounds of optimisation, where 0 to 20 are allowed", stage,
                                       optimisation_rounds));
    if (max_tets == 0) throw InvalidInput("netgen: no tetrahedra are allowed");
    if (!(max_seconds > 0))
        throw InvalidInput(fmt::format("netgen: {} s are allowed, where more than 0 is needed", max_seconds));
}

#ifndef VDBGEO_HAS_NETGEN

bool have_netgen() { return false; }
TetMesh netgen_tetrahedra(const TriMesh&, const NetgenOptions&, const Progress&) {
    throw NumericalError("not there yet");
}

}  // namespace vdbgeo
