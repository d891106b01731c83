#include "vdbgeo/surface/level_set.h"

#include <fmt/format.h>
#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tree/LeafManager.h>
#include <openvdb/tree/NodeManager.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/volume/derived_grid.h"
#include "vdbgeo/volume/interrupter.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;

/// The field whose samples at or above `level` are inside, and empty outside the map's box.
struct Field {
    FloatTree::ConstPtr tree;
    double level = 0;
};

Field dense_field(const DensityMap& map, double isovalue) {
    Field field{map.grid->constTreePtr(), isovalue};
    if (map.grid->getGridClass() == openvdb::GRID_LEVEL_SET) {
        const auto turned = std::make_shared<FloatTree>(*field.tree);
        openvdb::tree::NodeManager<FloatTree> nodes(*turned);
        nodes.foreachTopDown([](auto& node, std::size_t = 0) {
            for (auto it = node.beginValueAll(); it; ++it) it.setValue(-*it);
        });
        turned->root().setBackground(-turned->background(), /*updateChildNodes=*/false);
        field = {turned, -isovalue};
    }
    if (field.tree->background() >= static_cast<float>(field.level)) {
        // A dense background would fill the world. As far below the level as the densest sample is above it:
        // the surface then closes half a voxel outside.
        const double above = std::max(map.statistics.max - field.level, 1e-3 * std::abs(field.level) + 1e-30);
        const auto emptied = std::make_shared<FloatTree>(*field.tree);
        openvdb::tools::changeBackground(*emptied, static_cast<float>(field.level - above));
        field.tree = emptied;
    }
    return field;
}

/// Where the level set's voxels lie: on the map's, or on cubes of the smallest voxel length over the same
/// box.
struct Target {
    Frame frame;
    bool same = true;
    Eigen::Affine3d from_map = Eigen::Affine3d::Identity();  ///< index of the map → index of the level set
};

Target target_of(const DensityMap& map) {
    Target target;
    target.frame = map.frame;
    if (transform_of(map.frame)->hasUniformScale()) return target;
    target.same = false;
    const double h = map.frame.voxel_size().minCoeff();
    Vec3d low = map.frame.origin, high = low;
    for (int corner = 0; corner < 8 && map.frame.bounded(); ++corner) {
        const Vec3d at(corner & 1, corner >> 1 & 1, corner >> 2);
        const Vec3d p =
            map.frame.to_world(at.cwiseProduct((map.frame.size.array() - 1).matrix().cast<double>()));
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    target.frame.axes = h * Mat3d::Identity();
    target.frame.origin = low;
    if (map.frame.bounded())
        target.frame.size = ((high - low) / h).array().ceil().cast<int>().matrix() + Vec3i::Ones();
    target.from_map.linear() = map.frame.axes / h;
    target.from_map.translation() = (map.frame.origin - low) / h;
    return target;
}

/// Triangles in the indices of the map, shown to OpenVDB in those of the level set.
class Triangles {
 public:
    Triangles(const TriMesh& mesh, const Target& target) : mesh_(mesh), target_(target) {}
    std::size_t polygonCount() const { return mesh_.triangles.size(); }
    std::size_t pointCount() const { return mesh_.points.size(); }
    std::size_t vertexCount(std::size_t) const { return 3; }
    void getIndexSpacePoint(std::size_t n, std::size_t v, openvdb::Vec3d& out) const {
        Vec3d p = mesh_.points[mesh_.triangles[n][v]].cast<double>();
        if (!target_.same) p = target_.from_map * p;
        out = openvdb::Vec3d(p.x(), p.y(), p.z());
    }

 private:
    const TriMesh& mesh_;
    const Target& target_;
};

/// Gives distances the sign of the field, and takes what does not belong into the band out of it.
void set_signs(FloatTree& tree, const Field& field, const Target& target, float width) {
    const Eigen::Affine3d to_map = target.from_map.inverse();
    const float level = static_cast<float>(field.level);
    openvdb::tree::LeafManager<FloatTree> leaves(tree);
    leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
        openvdb::FloatGrid::ConstAccessor samples(*field.tree);
        for (auto it = leaf.beginValueOn(); it; ++it) {
            const openvdb::Coord ijk = it.getCoord();
            float density;
            if (target.same) {
                density = samples.getValue(ijk);
            } else {
                const Vec3d p = to_map * Vec3d(ijk.x(), ijk.y(), ijk.z());
                density = openvdb::tools::BoxSampler::sample(samples, openvdb::Vec3d(p.x(), p.y(), p.z()));
            }
            const float distance = std::min(*it, width);
            it.setValue(density >= level ? -distance : distance);
            if (distance >= width) it.setValueOff();
        }
    });
}

/// half · voxel as a float that is not below it: OpenVDB's check of level sets divides again.
float band_width(double half, double voxel) {
    float width = static_cast<float>(half * voxel);
    while (width / voxel < half) width = std::nextafter(width, std::numeric_limits<float>::infinity());
    return width;
}

}  // namespace

void LevelSetOptions::check() const {
    if (!(half_width >= 3 && half_width <= 100))
        throw InvalidInput(
            fmt::format("half the width of a level set is {} voxels, not 3 to 100", half_width));
}

FloatGrid::Ptr level_set(const DensityMap& map, double isovalue, const LevelSetOptions& options,
                         const Progress& progress) {
    options.check();
    if (!std::isfinite(isovalue)) throw InvalidInput("the isovalue is not a finite number");
    const Field field = dense_field(map, isovalue);
    const Target target = target_of(map);
    DensityMap unbounded;  // in its own indices: no rounding far from the world's origin
    unbounded.grid = FloatGrid::create(std::const_pointer_cast<FloatTree>(field.tree));
    unbounded.statistics = map.statistics;
    const TriMesh mesh = marching_cubes(unbounded, {field.level}, progress.part(0, 0.3));
    if (mesh.empty())
        throw NumericalError(
            fmt::format("no surface at the isovalue {:.6g}: the map's values lie between {:.6g} and {:.6g}",
                        isovalue, map.statistics.min, map.statistics.max));

    const auto transform = transform_of(target.frame);
    Interrupter interrupter(progress.part(0.3, 0.9));
    const auto grid = openvdb::tools::meshToVolume<FloatGrid>(
        interrupter, Triangles(mesh, target), *transform, static_cast<float>(options.half_width),
        static_cast<float>(options.half_width), openvdb::tools::UNSIGNED_DISTANCE_FIELD);
    interrupter.check();
    const float width = band_width(options.half_width, transform->voxelSize()[0]);
    openvdb::tools::changeBackground(grid->tree(), width);
    set_signs(grid->tree(), field, target, width);
    openvdb::tools::signedFloodFill(grid->tree());
    openvdb::tools::pruneLevelSet(grid->tree());
    progress.report(1);

    const std::string line =
        fmt::format("level set at {} half width {} voxels", isovalue, options.half_width);
    derive_from(*map.grid, target.frame, *grid, "surface", line);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    set_metadata(*grid, "vdbgeo_isovalue", isovalue);
    return grid;
}

}  // namespace vdbgeo
