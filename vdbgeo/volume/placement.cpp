#include "vdbgeo/volume/placement.h"

#include <fmt/format.h>
#include <openvdb/tree/NodeManager.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/derived_grid.h"

namespace vdbgeo {
namespace {

constexpr const char* program_key = "vdbgeo_for";
constexpr const char* units_key = "vdbgeo_units_per_A";
constexpr const char* centre_key = "vdbgeo_centre_A";

Mat3d turn_of(SceneProgram program) {
    Mat3d turn = Mat3d::Identity();
    if (program == SceneProgram::houdini) turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    return turn;
}

template <class Tree, class Op>
void change_values(Tree& tree, const Op& op) {
    openvdb::tree::NodeManager<Tree> nodes(tree);
    nodes.foreachTopDown([&](auto& node, std::size_t = 0) {
        for (auto it = node.beginValueAll(); it; ++it) it.setValue(op(*it));
    });
    tree.root().setBackground(op(tree.background()), /*updateChildNodes=*/false);
}

/// Distances in other units. The band's half width stays at least as many voxels as it was: OpenVDB's check
/// of level sets divides again.
void scale_distances(openvdb::FloatGrid& grid, double factor, double old_voxel, double new_voxel) {
    const float old_width = grid.background();
    float width = static_cast<float>(old_width * factor);
    const double half = std::min(old_width / old_voxel, std::round(old_width / old_voxel));
    while (width > 0 && width / new_voxel < half)
        width = std::nextafter(width, std::numeric_limits<float>::infinity());
    change_values(grid.tree(), [&](float v) {
        if (std::abs(v) == old_width) return std::copysign(width, v);
        return static_cast<float>(v * factor);
    });
}

void turn_vectors(openvdb::Vec3SGrid& grid, const Mat3d& turn) {
    change_values(grid.tree(), [&](const openvdb::Vec3s& v) {
        const Vec3d t = turn * Vec3d(v.x(), v.y(), v.z());
        return openvdb::Vec3s(static_cast<float>(t.x()), static_cast<float>(t.y()),
                              static_cast<float>(t.z()));
    });
}

/// p → units · turn · (p - centre) of everything that has a place.
void move(openvdb::GridBase& grid, const Mat3d& turn, double units, const Frame& placed) {
    const double old_voxel = grid.transform().voxelSize()[0];
    grid.setTransform(transform_of(placed));
    const double new_voxel = grid.transform().voxelSize()[0];
    if (auto* floats = dynamic_cast<openvdb::FloatGrid*>(&grid)) {
        if (grid.getGridClass() == openvdb::GRID_LEVEL_SET)
            scale_distances(*floats, units, old_voxel, new_voxel);
    } else if (auto* vectors = dynamic_cast<openvdb::Vec3SGrid*>(&grid)) {
        if (!turn.isIdentity()) turn_vectors(*vectors, turn);
    }
}

}  // namespace

const char* name_of(SceneProgram program) { return program == SceneProgram::houdini ? "houdini" : "blender"; }

void PlacementOptions::check() const {
    if (!(units_per_A >= 1e-6 && units_per_A <= 1e6))
        throw InvalidInput(fmt::format("{} units per A: 1e-6 to 1e6 are", units_per_A));
    if (!centre_A.allFinite()) throw InvalidInput("the centre is not finite");
}

Vec3d centre_of_box(const DensityMap& map) {
    if (map.frame.bounded())
        return map.frame.to_world((map.frame.size.array() - 1).matrix().cast<double>() / 2);
    const auto box = map.grid->evalActiveVoxelBoundingBox();
    if (box.empty()) return map.frame.origin;
    const auto middle = box.getCenter();
    return map.frame.to_world(Vec3d(middle.x(), middle.y(), middle.z()));
}

void place(openvdb::GridBase& grid, const PlacementOptions& options) {
    options.check();
    if (const auto before = placement_of(grid))
        throw InvalidInput(
            fmt::format("grid '{}' is placed for {} already", grid.getName(), name_of(before->program)));
    const Mat3d turn = turn_of(options.program);
    Frame frame = frame_of(grid.transform());
    frame.axes = options.units_per_A * turn * frame.axes;
    frame.origin = options.units_per_A * turn * (frame.origin - options.centre_A);
    try {
        move(grid, turn, options.units_per_A, frame);
    } catch (const openvdb::ArithmeticError&) {
        throw InvalidInput(fmt::format("a voxel of {} cubic units is too small: take more units per A",
                                       frame.voxel_volume()));
    }
    const Vec3d& c = options.centre_A;
    set_metadata(grid, program_key, std::string(name_of(options.program)));
    set_metadata(grid, units_key, options.units_per_A);
    set_metadata(grid, centre_key, openvdb::Vec3d(c.x(), c.y(), c.z()));
    add_history(grid, fmt::format("placed for {}, {} units per A, origin at {},{},{} A",
                                  name_of(options.program), options.units_per_A, c.x(), c.y(), c.z()));
}

std::optional<PlacementOptions> placement_of(const openvdb::GridBase& grid) {
    const auto program = grid.getMetadata<openvdb::StringMetadata>(program_key);
    const auto units = grid.getMetadata<openvdb::DoubleMetadata>(units_key);
    const auto centre = grid.getMetadata<openvdb::Vec3DMetadata>(centre_key);
    if (!program || !units || !centre) return {};
    PlacementOptions options;
    options.program = program->value() == "houdini" ? SceneProgram::houdini : SceneProgram::blender;
    options.units_per_A = units->value();
    options.centre_A = Vec3d(centre->value().x(), centre->value().y(), centre->value().z());
    options.check();
    return options;
}

void undo_placement(openvdb::GridBase& grid) {
    const auto placement = placement_of(grid);
    if (!placement) return;
    const Mat3d back = turn_of(placement->program).transpose();
    Frame frame = frame_of(grid.transform());
    frame.axes = back * frame.axes / placement->units_per_A;
    frame.origin = back * frame.origin / placement->units_per_A + placement->centre_A;
    move(grid, back, 1 / placement->units_per_A, frame);
    for (const char* key : {program_key, units_key, centre_key}) grid.removeMeta(key);
    add_history(grid, "placed back, in A");
}

}  // namespace vdbgeo
