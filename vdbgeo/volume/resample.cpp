#include "vdbgeo/volume/resample.h"

#include <fmt/format.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include <atomic>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/derived_grid.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;

bool same_place(const Frame& a, const Frame& b) {
    const double tolerance = 1e-3 * a.voxel_size().minCoeff();
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d at = Vec3d(corner & 1, corner >> 1 & 1, corner >> 2)
                             .cwiseProduct((a.size.array() - 1).matrix().cast<double>());
        if ((a.to_world(at) - b.to_world(at)).norm() > tolerance) return false;
    }
    return true;
}

bool is_outside(const Frame& frame, const Vec3d& index) {
    constexpr double slack = 1e-6;
    return frame.bounded() && ((index.array() < -slack).any() ||
                               (index.array() > (frame.size.array() - 1).cast<double>() + slack).any());
}

}  // namespace

SampledMap sample_on(const DensityMap& other, const DensityMap& reference, const std::string& name,
                     const SampleOptions& options, const Progress& progress) {
    if (name.empty()) throw InvalidInput("a grid without a name");
    SampledMap result;
    result.by_index = other.frame.bounded() && other.frame.size == reference.frame.size;
    result.frames_differ = result.by_index && !same_place(reference.frame, other.frame);

    const float background = other.grid->background();
    const auto tree =
        std::make_shared<FloatTree>(reference.grid->constTree(), background, openvdb::TopologyCopy());
    if (options.within) tree->topologyIntersection(options.within->constTree());
    tree->voxelizeActiveTiles();
    progress.report(0.1);
    const Mat3d to_index = other.frame.axes.inverse();
    std::atomic<std::uint64_t> outside{0};
    openvdb::tree::LeafManager<FloatTree> leaves(*tree);
    leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
        FloatGrid::ConstAccessor samples(other.grid->constTree());
        std::uint64_t beyond = 0;
        for (auto it = leaf.beginValueOn(); it; ++it) {
            const openvdb::Coord ijk = it.getCoord();
            if (result.by_index) {
                it.setValue(samples.getValue(ijk));
                continue;
            }
            const Vec3d world = reference.frame.to_world(Vec3d(ijk.x(), ijk.y(), ijk.z()));
            const Vec3d at = to_index * (world - other.frame.origin);
            const bool out = is_outside(other.frame, at);
            beyond += out;
            it.setValue(
                out ? background
                    : openvdb::tools::BoxSampler::sample(samples, openvdb::Vec3d(at.x(), at.y(), at.z())));
        }
        outside += beyond;
    });
    openvdb::tools::prune(*tree);
    progress.report(1);
    result.outside = outside;
    result.grid = FloatGrid::create(tree);
    derive_from(*other.grid, reference.frame, *result.grid, name,
                fmt::format("sampled {}", result.by_index ? "index for index" : "by position"));
    return result;
}

}  // namespace vdbgeo
