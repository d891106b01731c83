#include "vdbgeo/volume/derivatives.h"

#include <openvdb/tools/GridOperators.h>
#include <openvdb/tree/LeafManager.h>

#include "vdbgeo/volume/derived_grid.h"
#include "vdbgeo/volume/interrupter.h"

namespace vdbgeo {

openvdb::Vec3SGrid::Ptr gradient(const DensityMap& map, const Progress& progress) {
    Interrupter interrupter(progress);
    using Operator = openvdb::tools::Gradient<openvdb::FloatGrid, openvdb::BoolGrid, Interrupter>;
    const auto grid = Operator(*map.grid, &interrupter).process();
    interrupter.check();
    derive_from(*map.grid, map.frame, *grid, "gradient", "gradient per A");
    grid->setVectorType(openvdb::VEC_COVARIANT);
    progress.report(1);
    return grid;
}

openvdb::FloatGrid::Ptr mean_curvature(const DensityMap& map, const Progress& progress) {
    Interrupter interrupter(progress);
    using Operator = openvdb::tools::MeanCurvature<openvdb::FloatGrid, openvdb::BoolGrid, Interrupter>;
    const auto grid = Operator(*map.grid, &interrupter).process();
    interrupter.check();
    // OpenVDB takes the normal along ∇u, which is outward in a level set but inward in a density.
    if (map.grid->getGridClass() != openvdb::GRID_LEVEL_SET)
        openvdb::tree::LeafManager<openvdb::FloatTree>(grid->tree()).foreach ([](auto& leaf, std::size_t) {
            for (auto it = leaf.beginValueOn(); it; ++it) it.setValue(-*it);
        });
    derive_from(*map.grid, map.frame, *grid, "mean_curvature", "mean curvature per A, convex where positive");
    progress.report(1);
    return grid;
}

}  // namespace vdbgeo
