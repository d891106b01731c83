#include "apps/surface_flags.h"

#include <fmt/format.h>
#include <openvdb/tools/ValueTransformer.h>

#include "apps/flags.h"
#include "apps/surface_in_blocks.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/cap.h"
#include "vdbgeo/surface/marching_cubes.h"

namespace vdbgeo::app {
namespace {

/// The voxels of a map or grid that are above 0.
openvdb::BoolGrid::Ptr read_mask(const std::string& file, const Frame& frame) {
    const MapFile in = read_map(file, {}, {});
    if (in.map.frame.bounded() && frame.bounded() && in.map.frame.size != frame.size)
        throw InvalidInput(fmt::format("{}: the mask has {} x {} x {} voxels, the map {} x {} x {}", file,
                                       in.map.frame.size.x(), in.map.frame.size.y(), in.map.frame.size.z(),
                                       frame.size.x(), frame.size.y(), frame.size.z()));
    auto mask = openvdb::BoolGrid::create(false);
    mask->tree().topologyUnion(in.map.grid->tree());
    openvdb::tools::foreach (mask->beginValueOn(), [&in](const openvdb::BoolGrid::ValueOnIter& it) {
        const bool on = in.map.grid->tree().getValue(it.getCoord()) > 0;
        it.setValue(on);
        it.setActiveState(on);
    });
    return mask;
}

}  // namespace

void ComponentFlags::add(CLI::App& app) {
    app.add_option("--keep-largest", filter.keep_largest,
                   "Keep this many pieces, the largest by area, with their cavities [all]");
    app.add_option("--min-volume", filter.min_volume_A3, "Drop closed pieces of less than this volume, in Å³")
        ->capture_default_str();
    app.add_option("--min-area", filter.min_area_A2, "Drop pieces of less than this area, in Å²")
        ->capture_default_str();
    app.add_flag("--drop-border", filter.drop_border, "Drop pieces that touch the border of the map");
    app.add_flag("--drop-cavities", filter.drop_cavities, "Drop the walls of cavities");
}

bool ComponentFlags::any() const {
    return filter.keep_largest || filter.min_volume_A3 > 0 || filter.min_area_A2 > 0 || filter.drop_border ||
           filter.drop_cavities;
}

void SurfaceFlags::add(CLI::App& app) {
    app.add_option("--method", method,
                   "marching-cubes (fast, exact topology), dual (smoother, adaptive) or delaunay (every "
                   "triangle well shaped)")
        ->check(CLI::IsMember({"marching-cubes", "dual", "delaunay"}).description(""))
        ->capture_default_str();
    app.add_flag("--cap", cap, "marching-cubes: close the surface where it meets the border of the map");
    app.add_option("--adaptivity", dual.adaptivity,
                   "dual: 0 (a vertex a cell) to 1 (larger faces where flat)")
        ->capture_default_str();
    app.add_option("--surface-mask", mask, "dual: extract only where this map or VDB file is above 0");
    app.add_option("--angle", delaunay.angle_deg, "delaunay: least angle of a triangle, in degrees")
        ->capture_default_str();
    app.add_option("--radius", radius,
                   fmt::format("delaunay: largest radius of a triangle's surface ball, in voxels, or in Å as "
                               "1.5A [{}]",
                               delaunay.radius));
    app.add_option(
        "--distance", distance,
        fmt::format("delaunay: largest distance of a triangle from the surface, in voxels, or in Å "
                    "as 1.5A [{}]",
                    delaunay.distance));
    app.add_option("--max-vertices", delaunay.max_vertices, "delaunay: give up beyond this many vertices")
        ->capture_default_str();
    app.add_option("--max-seconds", delaunay.max_seconds, "delaunay: give up after this time, in seconds")
        ->capture_default_str();
}

void SurfaceFlags::finish(const CLI::App& app) {
    radius_in_A_ = parse_length("--radius", "voxels", radius, delaunay.radius);
    distance_in_A_ = parse_length("--distance", "voxels", distance, delaunay.distance);
    check_usage(delaunay);
    check_usage(dual);
    if (method == "delaunay" && !have_delaunay())
        throw UsageError("--method delaunay: this build has no CGAL");
    if (cap && method != "marching-cubes")
        throw UsageError(fmt::format("--cap: the {} surface is closed at the border by itself", method));
    if (method != "dual") refuse_flags(app, {"--adaptivity", "--surface-mask"}, "belongs to --method dual");
    if (method != "delaunay")
        refuse_flags(app, {"--angle", "--radius", "--distance", "--max-vertices", "--max-seconds"},
                     "belongs to --method delaunay");
}

DensityMap turned_over(const DensityMap& level_set) {
    DensityMap map = level_set;
    map.grid = openvdb::FloatGrid::create(*level_set.grid);
    map.grid->setTree(std::make_shared<openvdb::FloatTree>(level_set.grid->tree()));
    turn_over(map);
    return map;
}

TriMesh SurfaceFlags::extract(const MapFile& in, double isovalue, const Progress& progress) const {
    const double level = in.level_set ? -isovalue : isovalue;
    const DensityMap map = in.level_set ? turned_over(in.map) : in.map;
    const double voxel = map.frame.voxel_size().minCoeff();
    if (method == "dual") {
        DualSurfaceOptions options = dual;
        options.isovalue = level;
        if (!mask.empty()) options.mask = read_mask(mask, map.frame);
        return dual_surface(map, options, progress);
    }
    if (method == "delaunay") {
        DelaunaySurfaceOptions options = delaunay;
        options.isovalue = level;
        if (radius_in_A_) options.radius /= voxel;
        if (distance_in_A_) options.distance /= voxel;
        return delaunay_surface(map, options, progress);
    }
    TriMesh mesh = marching_cubes(map, {level}, progress.part(0, cap ? 0.8 : 1));
    return cap ? cap_border(std::move(mesh), map, level, progress.part(0.8, 1)) : mesh;
}

}  // namespace vdbgeo::app
