#include "vdbgeo/volume/density_map.h"

#include <fmt/format.h>
#include <openvdb/tools/ValueTransformer.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr const char* size_key = "vdbgeo_size";
constexpr const char* history_key = "vdbgeo_history";

template <class T>
void set(openvdb::MetaMap& metadata, const std::string& name, const T& value) {
    metadata.removeMeta(name);
    metadata.insertMeta(name, openvdb::TypedMetadata<T>(value));
}

Statistics statistics_of_active(const openvdb::FloatGrid& grid) {
    Statistics s;
    double sum = 0, squares = 0;
    for (auto it = grid.cbeginValueOn(); it; ++it) {
        const double v = *it;
        const auto n = it.getVoxelCount();
        if (!std::isfinite(v)) {
            s.non_finite += n;
            continue;
        }
        s.count += n;
        s.min = std::min(s.min, v);
        s.max = std::max(s.max, v);
        sum += v * static_cast<double>(n);
        squares += v * v * static_cast<double>(n);
    }
    if (s.count > 0) {
        const double n = static_cast<double>(s.count);
        s.mean = sum / n;
        s.rms = std::sqrt(std::max(0.0, squares / n - s.mean * s.mean));
    }
    s.count += s.non_finite;
    return s;
}

Frame frame_of_transform(const openvdb::math::Transform& transform) {
    if (!transform.isLinear()) throw InvalidInput("the grid's transform is not linear (a frustum, say)");
    Frame frame;
    const auto origin = transform.indexToWorld(openvdb::Vec3d(0, 0, 0));
    frame.origin = Vec3d(origin.x(), origin.y(), origin.z());
    for (int a = 0; a < 3; ++a) {
        openvdb::Vec3d unit(0, 0, 0);
        unit[a] = 1;
        const auto step = transform.indexToWorld(unit) - origin;
        frame.axes.col(a) = Vec3d(step.x(), step.y(), step.z());
    }
    if (!(frame.voxel_volume() > 0) || !std::isfinite(frame.voxel_volume()) || !frame.origin.allFinite())
        throw InvalidInput("the grid's transform is singular");
    return frame;
}

openvdb::math::Transform::Ptr transform_of(const Frame& frame) {
    namespace vm = openvdb::math;
    const Mat3d& axes = frame.axes;
    if (axes.isDiagonal(0)) {  // the plainest map: exact, and open to very small voxels
        const openvdb::Vec3d scale(axes(0, 0), axes(1, 1), axes(2, 2));
        const openvdb::Vec3d shift(frame.origin.x(), frame.origin.y(), frame.origin.z());
        if (scale[0] == scale[1] && scale[1] == scale[2])
            return std::make_shared<vm::Transform>(
                vm::MapBase::Ptr(new vm::UniformScaleTranslateMap(scale[0], shift)));
        return std::make_shared<vm::Transform>(vm::MapBase::Ptr(new vm::ScaleTranslateMap(scale, shift)));
    }
    vm::Mat4d m = vm::Mat4d::identity();  // row vectors: row a is the step along axis a
    for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c) m(a, c) = axes(c, a);
    for (int c = 0; c < 3; ++c) m(3, c) = frame.origin[c];
    return vm::Transform::createLinearTransform(m);
}

}  // namespace

void store_frame(DensityMap& map) {
    map.grid->setTransform(transform_of(map.frame));
    if (map.frame.bounded())
        set(*map.grid, size_key, openvdb::Vec3i(map.frame.size.x(), map.frame.size.y(), map.frame.size.z()));
    else
        map.grid->removeMeta(size_key);
    const Statistics& s = map.statistics;
    set(*map.grid, "vdbgeo_samples", static_cast<std::int64_t>(s.count));
    set(*map.grid, "vdbgeo_non_finite", static_cast<std::int64_t>(s.non_finite));
    set(*map.grid, "vdbgeo_min", s.min);
    set(*map.grid, "vdbgeo_max", s.max);
    set(*map.grid, "vdbgeo_mean", s.mean);
    set(*map.grid, "vdbgeo_rms", s.rms);
}

DensityMap map_from_grid(const openvdb::FloatGrid::Ptr& grid) {
    DensityMap map;
    map.grid = grid;
    map.frame = frame_of_transform(grid->transform());
    const auto number = [&](const char* name) { return grid->getMetadata<openvdb::DoubleMetadata>(name); };
    if (const auto size = grid->getMetadata<openvdb::Vec3IMetadata>(size_key)) {
        const Vec3i box(size->value().x(), size->value().y(), size->value().z());
        if (box.minCoeff() < 1) throw InvalidInput(fmt::format("metadata {} is not a size", size_key));
        map.frame.size = box;
    }
    const auto samples = grid->getMetadata<openvdb::Int64Metadata>("vdbgeo_samples");
    const auto non_finite = grid->getMetadata<openvdb::Int64Metadata>("vdbgeo_non_finite");
    const auto min = number("vdbgeo_min"), max = number("vdbgeo_max"), mean = number("vdbgeo_mean"),
               rms = number("vdbgeo_rms");
    if (samples && non_finite && min && max && mean && rms) {
        map.statistics = {static_cast<std::uint64_t>(samples->value()),
                          static_cast<std::uint64_t>(non_finite->value()),
                          min->value(),
                          max->value(),
                          mean->value(),
                          rms->value()};
    } else {
        map.statistics = statistics_of_active(*grid);
    }
    return map;
}

void add_history(openvdb::GridBase& grid, const std::string& line) {
    std::string history;
    if (const auto old = grid.getMetadata<openvdb::StringMetadata>(history_key))
        history = old->value() + "\n";
    set(grid, history_key, history + line);
}

}  // namespace vdbgeo
