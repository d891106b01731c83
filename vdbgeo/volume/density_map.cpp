#include "vdbgeo/volume/density_map.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/noted_statistics.h"

namespace vdbgeo {
namespace {

constexpr const char* size_key = "vdbgeo_size";
constexpr const char* history_key = "vdbgeo_history";

template <class T>
void set(openvdb::MetaMap& metadata, const std::string& name, const T& value) {
    metadata.removeMeta(name);
    metadata.insertMeta(name, openvdb::TypedMetadata<T>(value));
}

/// Welford's update for n equal samples: no sum of squares in which a large mean would drown the deviations.
void add(Statistics& s, double& squares, double v, std::uint64_t n) {
    s.count += n;
    if (!std::isfinite(v)) {
        s.non_finite += n;
        return;
    }
    s.min = std::min(s.min, v);
    s.max = std::max(s.max, v);
    const double step = v - s.mean, many = static_cast<double>(n);
    s.mean += step * many / static_cast<double>(s.count - s.non_finite);
    squares += step * (v - s.mean) * many;
}

}  // namespace

Frame frame_of(const openvdb::math::Transform& transform) {
    if (!transform.isLinear()) throw InvalidInput("the grid's transform is not linear (a frustum, say)");
    Frame frame;
    const auto origin = transform.indexToWorld(openvdb::Vec3d(0, 0, 0));
    frame.origin = Vec3d(origin.x(), origin.y(), origin.z());
    for (int a = 0; a < 3; ++a) {
        openvdb::Vec3d unit(0, 0, 0);
        unit[a] = 1;
        // Not as a difference of world positions: far from the world's origin that would round.
        const auto step = transform.baseMap()->applyJacobian(unit);
        frame.axes.col(a) = Vec3d(step.x(), step.y(), step.z());
    }
    if (!(frame.voxel_volume() > 0) || !std::isfinite(frame.voxel_volume()) || !frame.origin.allFinite())
        throw InvalidInput("the grid's transform is singular");
    return frame;
}

openvdb::math::Transform::Ptr transform_of(const Frame& frame) {
    namespace vm = openvdb::math;
    const Mat3d& axes = frame.axes;
    const openvdb::Vec3d origin(frame.origin.x(), frame.origin.y(), frame.origin.z());
    if (!axes.isDiagonal(0)) {
        vm::Mat4d m = vm::Mat4d::identity();  // row vectors: row a is the step along axis a
        for (int a = 0; a < 3; ++a)
            for (int c = 0; c < 3; ++c) m(a, c) = axes(c, a);
        m.setTranslation(origin);
        return vm::Transform::createLinearTransform(m);
    }
    const openvdb::Vec3d scale(axes(0, 0), axes(1, 1), axes(2, 2));
    const bool uniform = scale[0] == scale[1] && scale[1] == scale[2];
    const auto transform =
        std::make_shared<vm::Transform>(uniform ? vm::MapBase::Ptr(new vm::UniformScaleMap(scale[0]))
                                                : vm::MapBase::Ptr(new vm::ScaleMap(scale)));
    // Afterwards: Transform's constructor would take the scale from differences of moved points, and round
    // it.
    if (origin != openvdb::Vec3d(0, 0, 0)) transform->postTranslate(origin);
    return transform;
}

void store_frame(DensityMap& map) {
    if (!map.frame.axes.allFinite() || !map.frame.origin.allFinite())
        throw InvalidInput("the map's frame is not finite");
    try {
        map.grid->setTransform(transform_of(map.frame));
    } catch (const openvdb::ArithmeticError&) {
        throw InvalidInput(
            fmt::format("a voxel of {} A3 is too small: OpenVDB takes 3e-15 and less for a flat one",
                        map.frame.voxel_volume()));
    }
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
    map.frame = frame_of(grid->transform());
    if (const auto size = grid->getMetadata<openvdb::Vec3IMetadata>(size_key)) {
        const Vec3i box(size->value().x(), size->value().y(), size->value().z());
        if (box.minCoeff() < 1) throw InvalidInput(fmt::format("metadata {} is not a size", size_key));
        map.frame.size = box;
    }
    if (const auto noted = noted_statistics(*grid)) {
        map.statistics = *noted;
    } else {
        ActiveStatistics all;
        all.add(*grid);
        map.statistics = all.result();
    }
    return map;
}

std::optional<Statistics> noted_statistics(const openvdb::MetaMap& metadata) {
    const auto count = [&](const char* name) { return metadata.getMetadata<openvdb::Int64Metadata>(name); };
    const auto number = [&](const char* name) { return metadata.getMetadata<openvdb::DoubleMetadata>(name); };
    const auto samples = count("vdbgeo_samples"), non_finite = count("vdbgeo_non_finite");
    const auto min = number("vdbgeo_min"), max = number("vdbgeo_max"), mean = number("vdbgeo_mean"),
               rms = number("vdbgeo_rms");
    if (!samples || !non_finite || !min || !max || !mean || !rms || non_finite->value() < 0 ||
        samples->value() < non_finite->value())
        return {};
    Statistics s;
    s.count = static_cast<std::uint64_t>(samples->value());
    s.non_finite = static_cast<std::uint64_t>(non_finite->value());
    s.min = min->value();
    s.max = max->value();
    s.mean = mean->value();
    s.rms = rms->value();
    return s;
}

void ActiveStatistics::add(const openvdb::FloatGrid& grid) {
    for (auto it = grid.cbeginValueOn(); it; ++it) vdbgeo::add(sum_, squares_, *it, it.getVoxelCount());
}

Statistics ActiveStatistics::result() const {
    Statistics s = sum_;
    const std::uint64_t finite = s.count - s.non_finite;
    if (finite > 0) s.rms = std::sqrt(squares_ / static_cast<double>(finite));
    return s;
}

void add_history(openvdb::GridBase& grid, const std::string& line) {
    std::string history;
    if (const auto old = grid.getMetadata<openvdb::StringMetadata>(history_key))
        history = old->value() + "\n";
    set(grid, history_key, history + line);
}

}  // namespace vdbgeo
