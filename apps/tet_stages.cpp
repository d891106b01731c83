#include "apps/tet_stages.h"

#include <fmt/format.h>

#include <algorithm>

#include "apps/label_stages.h"
#include "apps/stages.h"
#include "vdbgeo/measure/adaptive_curvature.h"
#include "vdbgeo/measure/one_ring.h"
#include "vdbgeo/measure/requirements.h"
#include "vdbgeo/surface/cap.h"
#include "vdbgeo/surface/level_set.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/tet/map_projection.h"
#include "vdbgeo/tet/size_field.h"

namespace vdbgeo::app {
namespace {

/// Voxels of a level set made of a mesh, for each side of a cube at the surface.
constexpr double voxels_a_cell = 1.5;

ComponentFilter surface_filter(const TetComponentFilter& filter) {
    ComponentFilter f;
    f.keep_largest = filter.keep_largest;
    f.min_volume_A3 = filter.min_volume_A3;
    return f;
}

TriMesh kept(TriMesh mesh, const std::string& file, const TetComponentFilter& filter) {
    if (!filter.any()) return mesh;
    mesh = filter_components(mesh, surface_filter(filter));
    if (mesh.empty())
        throw NumericalError(
            fmt::format("{}: no piece is left; drop fewer (--keep-largest, --min-volume)", file));
    return mesh;
}

SizeField size_field(const TetInput& input, const TetFlags& flags, const Progress& progress) {
    if (flags.size_by().empty()) return {};
    if (flags.size_by() == "density") {
        if (input.source != TetSource::map)
            throw UsageError("--size-by density: needs a map, not a mesh or labels");
        DensitySizeOptions o;
        o.min_A = flags.size_low();
        o.max_A = flags.size_high();
        o.low = input.isovalue;
        o.high = input.map.statistics.max;
        return density_size(input.map, o);
    }
    TriMesh surface = input.surface;
    attach(surface, adaptive_curvature(surface, {}, progress));
    CurvatureSizeOptions o;
    o.min_A = flags.size_low();
    o.max_A = flags.size_high();
    return curvature_size(surface, o);
}

TetMesh by_stuffing(const TetInput& input, const TetFlags& flags, const Progress& progress) {
    if (input.source == TetSource::map)
        return isosurface_stuffing(input.map, input.isovalue, flags.stuffing(input.unit_A), progress);
    // A mesh: its level set, on voxels in proportion to the cubes.
    StuffingOptions o = flags.stuffing(input.unit_A);
    const double side = flags.cell_given() ? o.cell * input.unit_A : input.unit_A;
    o.cell = voxels_a_cell;
    const auto grid = mesh_level_set(input.mesh, side / voxels_a_cell, {}, progress.part(0, 0.5));
    return isosurface_stuffing(turned_over(map_from_grid(grid)), 0, o, progress.part(0.5, 1));
}

TetMesh by_cgal(const TetInput& input, const TetFlags& flags, const Progress& progress) {
    DelaunayTetrahedraOptions o = flags.delaunay(input.unit_A);
    o.size = size_field(input, flags, progress.part(0, 0.1));
    const Progress rest = progress.part(0.1, 1);
    if (input.source == TetSource::labels)
        return delaunay_tetrahedra_of_labels(input.map, input.labels, o, rest);
    if (input.source == TetSource::mesh) return delaunay_tetrahedra(input.mesh, o, rest);
    return delaunay_tetrahedra(input.map, input.isovalue, o, rest);
}

/// Whether a triangle's corners lie on a line: refinement goes down to triangles that floats cannot hold.
bool has_flat_face(const TriMesh& mesh) {
    return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        return (b - a).cross(c - a).squaredNorm() == 0;
    });
}

/// The surface that is filled: the input itself, the labels' smooth ones, or of a map one whose triangles are
/// well shaped. Where rounding leaves a triangle of that flat, a radius a tenth smaller gives other
/// triangles.
TriMesh surface_to_fill(const TetInput& input, const TetFlags& flags, const TetComponentFilter& filter,
                        Session& session) {
    if (input.source != TetSource::map) return input.surface;
    const Progress progress = session.stage("surface");
    DelaunaySurfaceOptions o = flags.surface(input.unit_A);
    o.isovalue = input.isovalue;
    constexpr int most_tries = 4;
    for (int i = 0;; ++i, o.radius *= 0.9) {
        TriMesh mesh = kept(delaunay_surface(input.map, o, progress), input.file, filter);
        if (i + 1 == most_tries || !has_flat_face(mesh)) return mesh;
    }
}

SurfaceProjection projection_for(const TetInput& input, const std::string& method) {
    // TetGen and NetGen keep the surface that they were given.
    if (method == "tetgen" || method == "netgen" || input.source != TetSource::map) return {};
    return map_projection(input.map, input.isovalue);
}

}  // namespace

TetInput tet_input(const std::string& file, const MapFile& in, const Isovalue& rule,
                   const TetComponentFilter& filter, const Progress& progress) {
    TetInput input;
    input.file = file;
    naming(file, [&] {
        const double level = rule.resolve(in.map);
        input.map = in.level_set ? turned_over(in.map) : in.map;
        input.isovalue = in.level_set ? -level : level;
        const TriMesh open = marching_cubes(input.map, {input.isovalue}, progress.part(0, 0.8));
        input.surface = cap_border(open, input.map, input.isovalue, progress.part(0.8, 1));
    });
    if (input.surface.empty())
        throw NumericalError(
            fmt::format("{}: no surface at the isovalue {:.6g}: the map's values lie between {:.6g} and "
                        "{:.6g}; try another --iso",
                        file, input.isovalue, in.map.statistics.min, in.map.statistics.max));
    input.surface = kept(std::move(input.surface), file, filter);
    input.unit_A = input.map.frame.voxel_size().minCoeff();
    return input;
}

TetInput tet_input(const std::string& file, const MapFile& in, const std::vector<std::int64_t>& labels,
                   const Progress& progress) {
    need_labels(file, in.map);
    TetInput input;
    input.file = file;
    input.source = TetSource::labels;
    input.map = in.map;
    input.labels = labels;
    LabelSurfacesOptions o;
    o.labels = labels;
    const auto surfaces = naming(file, [&] { return label_surfaces(in.map, o, progress); });
    if (surfaces.empty()) throw NumericalError(fmt::format("{}: there is no label but 0", file));
    input.surface = join_labels(surfaces, file);
    input.unit_A = input.map.frame.voxel_size().minCoeff();
    return input;
}

TetInput tet_input(const std::string& file, TriMesh mesh, const TetComponentFilter& filter) {
    const MeshMeasures measures = measure_mesh(mesh);
    naming(file, [&] {
        require(measures, {true, true, false, true}, "tetrahedralize");
        if (*measures.volume_A3 <= 0)
            throw InvalidInput(
                fmt::format("tetrahedralize needs normals that point outward: the surface is inside out "
                            "(volume {:.4g} Å³); "
                            "try repair",
                            *measures.volume_A3));
    });
    TetInput input;
    input.file = file;
    input.source = TetSource::mesh;
    input.mesh = kept(std::move(mesh), file, filter);
    input.surface = input.mesh;
    input.unit_A = mean_edge(input.mesh);
    return input;
}

TetResult make_tets(const TetInput& input, const std::string& method, const TetFlags& flags,
                    const TetComponentFilter& filter, Session& session) {
    TetResult result;
    Clock clock;
    naming(input.file, [&] {
        if (method == "tetgen" || method == "netgen") {
            const TriMesh surface = surface_to_fill(input, flags, filter, session);
            result.surface_seconds = clock.lap();
            if (method == "tetgen") {
                TetgenOptions o = flags.tetgen();
                if (!flags.size_by().empty()) o.size = size_field(input, flags, session.stage("sizes"));
                result.mesh = tetgen_tetrahedra(surface, o, session.stage("tetgen"));
            } else {
                result.mesh = netgen_tetrahedra(surface, flags.netgen(input.unit_A), session.stage("netgen"));
            }
        } else {
            const Progress progress = session.stage(method);
            result.mesh =
                method == "cgal" ? by_cgal(input, flags, progress) : by_stuffing(input, flags, progress);
            result.mesh = filter_tet_components(std::move(result.mesh), filter);
        }
        if (result.mesh.empty())
            throw NumericalError("no tetrahedron is left; drop fewer, or take smaller ones");
        result.tet_seconds = clock.lap();
        if (!flags.optimize) return;
        TetOptimizeOptions o = flags.optimizer();
        o.onto_surface = projection_for(input, method);
        result.optimized = optimize_tets(result.mesh, o, session.stage("optimizing"));
        result.optimize_seconds = clock.lap();
    });
    return result;
}

}  // namespace vdbgeo::app
