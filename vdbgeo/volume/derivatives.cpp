#include "vdbgeo/volume/derivatives.h"

#include <openvdb/tools/GridOperators.h>
#include <openvdb/tree/LeafManager.h>

#include "vdbgeo/volume/derived_grid.h"
#include "vdbgeo/volume/interrupter.h"

namespace vdbgeo {
namespace {

using openvdb::BoolGrid;
using openvdb::FloatGrid;

/// One of OpenVDB's operators on the chosen voxels.
template <class Operator>
auto process(const DensityMap& map, const DerivativeOptions& options, const Progress& progress) {
    Interrupter interrupter(progress);
    BoolGrid::Ptr mask;
    if (options.within) {  // OpenVDB wants it in the same place; only its indices count here
        mask = BoolGrid::create(std::const_pointer_cast<openvdb::BoolTree>(options.within->constTreePtr()));
        mask->setTransform(map.grid->transform().copy());
    }
    auto op = mask ? Operator(*map.grid, *mask, &interrupter) : Operator(*map.grid, &interrupter);
    const auto grid = op.process();
    interrupter.check();
    return grid;
}

}  // namespace

openvdb::Vec3SGrid::Ptr gradient(const DensityMap& map, const DerivativeOptions& options,
                                 const Progress& progress) {
    const auto grid =
        process<openvdb::tools::Gradient<FloatGrid, BoolGrid, Interrupter>>(map, options, progress);
    derive_from(*map.grid, map.frame, *grid, "gradient", "gradient per A");
    grid->setVectorType(openvdb::VEC_COVARIANT);
    progress.report(1);
    return grid;
}

openvdb::FloatGrid::Ptr mean_curvature(const DensityMap& map, const DerivativeOptions& options,
                                       const Progress& progress) {
    const auto grid =
        process<openvdb::tools::MeanCurvature<FloatGrid, BoolGrid, Interrupter>>(map, options, progress);
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
