#include "vdbgeo/surface/delaunay_surface.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/split_non_manifold.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/seeded_delaunay.h"
#include "vdbgeo/surface/trilinear_field.h"

namespace vdbgeo {
namespace {

/// The solid {u ≥ isovalue} in coordinates whose unit is the smallest voxel step and whose origin is near the
/// surface. Where an unbounded grid's background is inside, the solid is what is outside.
class MapSolid final : public Solid {
 public:
    MapSolid(const DensityMap& map, double isovalue, const Vec3d& centre)
        : field_(map, isovalue),
          unit_(map.frame.voxel_size().minCoeff()),
          centre_(centre),
          to_index_(unit_ * map.frame.axes.inverse()),
          shift_(map.frame.axes.inverse() * (centre - map.frame.origin)),
          sign_(!map.frame.bounded() && map.grid->background() >= static_cast<float>(isovalue) ? -1 : 1) {}

    double operator()(const Vec3d& p) const override {
        const double v = field_(to_index_ * p + shift_);
        // The complement is open; what lies on the surface belongs to the solid.
        return sign_ < 0 ? (v >= 0 ? -std::max(v, std::numeric_limits<double>::min()) : -v) : v;
    }
    double unit() const { return unit_; }
    bool turned() const { return sign_ < 0; }
    Vec3d from_world(const Vec3d& world) const { return (world - centre_) / unit_; }
    Vec3d to_world(const Vec3d& p) const { return centre_ + unit_ * p; }

 private:
    const TrilinearField field_;
    const double unit_;
    const Vec3d centre_;
    const Mat3d to_index_;
    const Vec3d shift_;
    const double sign_;
};

/// Seeds on the parts of the box's border that lie inside: there the surface is the border.
std::vector<Vec3d> border_seeds(const Frame& frame, const MapSolid& solid, double spacing,
                                std::uint64_t most) {
    std::vector<Vec3d> seeds;
    if (!frame.bounded()) return seeds;
    const Vec3d steps = frame.voxel_size() / solid.unit();
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
            const int b = (axis + 1) % 3, c = (axis + 2) % 3;
            Vec3d index;
            index[axis] = side * (frame.size[axis] - 1);
            const int nb = std::max(1, static_cast<int>((frame.size[b] - 1) * steps[b] / spacing)),
                      nc = std::max(1, static_cast<int>((frame.size[c] - 1) * steps[c] / spacing));
            if (static_cast<double>(nb) * nc > 100.0 * static_cast<double>(most))
                throw NumericalError(fmt::format(
                    "a radius that small needs more than {} vertices: try a larger radius", most));
            for (int i = 0; i < nb; ++i)
                for (int j = 0; j < nc; ++j) {
                    // Staggered, so that no four lie on a circle.
                    index[b] = (i + 0.5 + 0.25 * (j % 2 ? 1 : -1)) * (frame.size[b] - 1) / nb;
                    index[c] = (j + 0.5) * (frame.size[c] - 1) / nc;
                    const Vec3d p = solid.from_world(frame.to_world(index));
                    const Vec3d in =
                        solid.from_world(frame.to_world(index + (side ? -1e-3 : 1e-3) * Vec3d::Unit(axis)));
                    if (solid(in) >= 0) seeds.push_back(p);
                }
        }
    return seeds;
}

}  // namespace

void DelaunaySurfaceOptions::check() const {
    if (!std::isfinite(isovalue)) throw InvalidInput("the isovalue must be a finite number");
    if (!(angle_deg >= 0 && angle_deg <= 30))
        throw InvalidInput(fmt::format("the angle bound is {:g}°: 0 to 30 are possible", angle_deg));
    if (!(radius >= 0.01 && radius <= 1000))
        throw InvalidInput(fmt::format("the radius bound is {:g} voxels: 0.01 to 1000 are possible", radius));
    if (!(distance >= 0.001 && distance <= 1000))
        throw InvalidInput(
            fmt::format("the distance bound is {:g} voxels: 0.001 to 1000 are possible", distance));
    if (max_vertices < 4 || max_vertices > TriMesh::max_vertices)
        throw InvalidInput(
            fmt::format("the bound on vertices is {}: 4 to 2^32 - 1 are possible", max_vertices));
    if (!(max_seconds > 0 && max_seconds <= 1e8))
        throw InvalidInput(
            fmt::format("the bound on time is {:g} s: above 0 and up to 1e8 are possible", max_seconds));
}

bool have_delaunay() { return have_delaunay_mesher(); }

TriMesh delaunay_surface(const DensityMap& map, const DelaunaySurfaceOptions& options,
                         const Progress& progress) {
    options.check();
    if (!have_delaunay()) throw InvalidInput("Delaunay surfaces need CGAL, which this build does not have");
    MarchingCubesOptions cubes;
    cubes.isovalue = options.isovalue;
    const TriMesh reference = marching_cubes(map, cubes, progress.part(0, 0.05));

    Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const Vec3f& p : reference.points) {
        low = low.cwiseMin(p.cast<double>());
        high = high.cwiseMax(p.cast<double>());
    }
    if (map.frame.bounded())
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3d last = (map.frame.size - Vec3i::Ones()).cast<double>();
            const Vec3d p = map.frame.to_world(
                {corner & 1 ? last.x() : 0, corner & 2 ? last.y() : 0, corner & 4 ? last.z() : 0});
            low = low.cwiseMin(p);
            high = high.cwiseMax(p);
        }
    if (!(low.x() <= high.x())) return {};
    const MapSolid solid(map, options.isovalue, 0.5 * (low + high));

    ReferenceMesh mesh;
    mesh.extra_seeds = border_seeds(map.frame, solid, 1.2 * options.radius, options.max_vertices);
    if (reference.empty() && mesh.extra_seeds.empty()) return {};
    for (const Vec3f& p : reference.points) mesh.points.push_back(solid.from_world(p.cast<double>()));
    mesh.triangles = reference.triangles;
    if (solid.turned())
        for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);

    const SeededBounds bounds{options.angle_deg, options.radius, options.distance, options.max_vertices,
                              options.max_seconds};
    const Vec3d margin = Vec3d::Constant(2);
    const DelaunayMesh found =
        seeded_delaunay(solid, solid.from_world(low) - margin, solid.from_world(high) + margin, mesh, bounds,
                        progress.part(0.05, 1));
    TriMesh out;
    for (const Vec3d& p : found.points) out.points.push_back(solid.to_world(p).cast<float>());
    for (Triangle t : found.triangles) {
        if (solid.turned()) std::swap(t[1], t[2]);
        out.triangles.push_back(t);
    }
    split_non_manifold(out);  // where sheets touch in one edge
    return out;
}

}  // namespace vdbgeo
