#include "vdbgeo/tet/isosurface_stuffing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/stuffing_fill.h"

namespace vdbgeo {

void StuffingOptions::check() const {
    if (!(cell > 0) || !std::isfinite(cell)) throw InvalidInput("the cell must be a finite length above 0");
    if (coarsening < 0 || coarsening > 8)
        throw InvalidInput(fmt::format("coarsening {}: cubes may double 0 to 8 times", coarsening));
    if (max_tets < 1) throw InvalidInput("at least one tetrahedron must be allowed");
}

TetMesh isosurface_stuffing(const DensityMap& map, double isovalue, const StuffingOptions& options,
                            const Progress& progress) {
    using namespace stuffing;
    options.check();
    if (!std::isfinite(isovalue)) throw InvalidInput("the isovalue must be a finite number");
    const Lattice lattice(map, isovalue, options.cell);
    // A block of 8³ cells has hundreds of tetrahedra as a rule, and at least a few.
    const std::uint64_t max_blocks = std::max<std::uint64_t>(options.max_tets / 4, 1 << 18);
    const std::vector<MarkedBlock> marked =
        mark_blocks(map, isovalue, lattice, max_blocks, progress.part(0, 0.1));
    if (marked.empty()) throw NumericalError(fmt::format("nothing crosses the isovalue {}", isovalue));
    const BlockTable table(marked, lattice, max_blocks);
    const SnappedLattice points(lattice, marked, table, progress.part(0.1, 0.5));
    const Octree octree(points, options.coarsening, progress.part(0.5, 0.55));
    TetMesh mesh = fill(lattice, points, octree, options.max_tets, progress.part(0.55, 1));
    if (mesh.empty())
        throw NumericalError(fmt::format(
            "no point of a lattice with cells of {:.3g} A is inside: try a smaller cell", lattice.cell()));
    return mesh;
}

}  // namespace vdbgeo
