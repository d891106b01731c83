#include "vdbgeo/remesh/simplify.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/surface_distance.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/remesh/edge_collapse.h"

namespace vdbgeo {

void SimplifyOptions::check() const {
    if (!faces && !max_distance)
        throw InvalidInput("simplify: neither a number of faces nor a largest distance is set");
    if (max_distance && !(std::isfinite(*max_distance) && *max_distance > 0))
        throw InvalidInput(
            fmt::format("simplify: largest distance {} A where a number above 0 is needed", *max_distance));
}

TriMesh simplify(const TriMesh& mesh, const SimplifyOptions& options, const Progress& progress) {
    options.check();
    const std::uint64_t faces = options.faces.value_or(0);
    EdgeCollapse collapse(mesh, "simplify");
    collapse.run(faces, {}, progress);
    return collapse.mesh(mesh);
}

}  // namespace vdbgeo
