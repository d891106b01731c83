#include "vdbgeo/flow/pde_transform.h"

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

/// a = a − b in the active voxels; both have the same leaves.
void subtract(openvdb::FloatTree& a, const openvdb::FloatTree& b) {
    std::vector<leaf::Leaf*> leaves;
    a.getNodes(leaves);
    parallel_for(leaves.size(), 64, [&](std::size_t i) {
        const leaf::Leaf* other = b.probeConstLeaf(leaves[i]->origin());
        const float* from = other->buffer().data();
        float* to = leaves[i]->buffer().data();
        for (auto it = leaves[i]->cbeginValueOn(); it; ++it) to[it.pos()] -= from[it.pos()];
    });
}

}  // namespace

void TransformOptions::check() const {
    sigma.check();
    if (passes.empty()) throw InvalidInput("a transform has at least one pass");
    for (const Pass& p : passes) {
        if (p.order < 0 || p.order > 15) throw InvalidInput("an order is 0 to 15");
        if (!std::isfinite(p.time) || p.time < 0) throw InvalidInput("a time is a number, 0 or more");
    }
}

void pde_transform(const openvdb::FloatGrid& grid, const TransformOptions& options, const ModeSink& sink,
                   const Progress& progress) {
    options.check();
    openvdb::FloatGrid::Ptr rest = grid.deepCopy();
    if (rest->tree().hasActiveTiles()) rest->tree().voxelizeActiveTiles();
    const auto count = static_cast<double>(options.passes.size());
    HyperdiffusionReport report;
    for (std::size_t k = 0; k < options.passes.size(); ++k) {
        HyperdiffusionOptions low_pass;
        low_pass.terms = {{options.passes[k].order, 1.0}};
        low_pass.sigma = options.sigma;
        low_pass.stepper = options.stepper;
        low_pass.time = options.passes[k].time;
        openvdb::FloatGrid::Ptr mode = rest->deepCopy();
        report = hyperdiffuse(*rest, low_pass, progress.part(double(k) / count, double(k + 1) / count));
        subtract(mode->tree(), rest->tree());
        sink(static_cast<int>(k), mode, report);
    }
    sink(static_cast<int>(options.passes.size()), rest, report);
}

}  // namespace vdbgeo
