#include "vdbgeo/tet/delaunay_tetrahedra.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/cap.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/mesh_solid.h"
#include "vdbgeo/surface/trilinear_field.h"
#include "vdbgeo/tet/label_domain.h"
#include "vdbgeo/tet/seeded_tetrahedra.h"

namespace vdbgeo {

namespace {

constexpr double precision = 1e-5;  // of places on the boundary, in voxels or mean edges

/// The solid {u ≥ isovalue} of a map's trilinear interpolant, in world coordinates.
class MapDomain final : public TetDomain {
 public:
    MapDomain(const DensityMap& map, double isovalue)
        : TetDomain(precision * map.frame.voxel_size().minCoeff()),
          field_(map, isovalue),
          origin_(map.frame.origin),
          to_index_(map.frame.axes.inverse()) {}

    std::int32_t region(const Vec3d& p) const override { return level(p) >= 0; }

    /// Regula falsi in the Illinois form, halving where a value is infinite or too little is gained.
    Crossing crossing(const Vec3d& a, std::int32_t ra, const Vec3d& b, std::int32_t rb) const override {
        Vec3d from = a, to = b;
        double u = level(from), v = level(to);
        int last = 0;
        for (int step = 0; step < 400; ++step) {
            const double length = (to - from).norm();
            if (!(length > tolerance_)) break;
            double t = u / (u - v);
            if (!std::isfinite(u) || !std::isfinite(v) || !std::isfinite(t) || step % 4 == 3) t = 0.5;
            const double margin = std::min(0.5, 0.5 * tolerance_ / length);
            t = std::min(1 - margin, std::max(margin, t));
            const Vec3d middle = from + t * (to - from);
            const double w = level(middle);
            if ((w >= 0) == (ra == 1)) {
                from = middle;
                u = w;
                if (last == 1) v /= 2;
                last = 1;
            } else {
                to = middle;
                v = w;
                if (last == 2) u /= 2;
                last = 2;
            }
        }
        return {0.5 * (from + to), {ra, rb}};
    }

 private:
    double level(const Vec3d& p) const { return field_(to_index_ * (p - origin_)); }

    const TrilinearField field_;
    const Vec3d origin_;
    const Mat3d to_index_;
};

/// The inside of a closed mesh.
class MeshDomain final : public TetDomain {
 public:
    MeshDomain(const std::vector<Vec3d>& points, const Array<Triangle>& triangles, double unit)
        : TetDomain(precision * unit), solid_(points, triangles) {}
    std::int32_t region(const Vec3d& p) const override { return solid_(p) > 0; }

 private:
    const MeshSolid solid_;
};

/// Edges come out this much longer than the radii that bound them, on average.
constexpr double edge_per_facet_size = 1.3, edge_per_cell_size = 1.25;

SeededTetOptions seeded_options(const DelaunayTetrahedraOptions& options, double unit) {
    SeededTetOptions out;
    out.bounds.facet_angle_deg = options.facet_angle_deg;
    out.bounds.facet_size = unit * options.facet_size;
    out.bounds.facet_distance = unit * options.facet_distance;
    out.bounds.cell_radius_edge = options.cell_radius_edge;
    out.bounds.cell_size = unit * options.cell_size;
    out.bounds.max_vertices = options.max_vertices;
    out.bounds.max_seconds = options.max_seconds;
    if (options.size)
        out.bounds.graded = [size = options.size, facet = edge_per_facet_size * out.bounds.facet_size,
                             cell = edge_per_cell_size * out.bounds.cell_size](const Vec3d& p) {
            const double wanted = size(p);
            const auto factor = [&](double edge) {
                return wanted > 0 ? std::clamp(wanted / edge, 1e-3, 1.0) : 1.0;
            };
            return std::array<double, 2>{factor(facet), factor(cell)};
        };
    out.optimization = {options.lloyd, options.odt, options.perturb, options.exude, options.sliver_bound_deg};
    out.parallel = options.parallel;
    return out;
}

void set_box(TetMesherBounds& bounds, const std::vector<Vec3d>& points, double margin) {
    bounds.low = Vec3d::Constant(std::numeric_limits<double>::infinity());
    bounds.high = -bounds.low;
    for (const Vec3d& p : points) {
        bounds.low = bounds.low.cwiseMin(p);
        bounds.high = bounds.high.cwiseMax(p);
    }
    bounds.low -= Vec3d::Constant(margin);
    bounds.high += Vec3d::Constant(margin);
}

ReferenceBoundary reference_of(const TriMesh& mesh, double reach) {
    ReferenceBoundary out;
    for (const Vec3f& p : mesh.points) out.points.push_back(p.cast<double>());
    out.triangles = mesh.triangles;
    out.part = connected_parts(out.points.size(), out.triangles);
    out.reach = reach;
    return out;
}

double mean_edge(const TriMesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k)
            sum += (mesh.points[t[k]] - mesh.points[t[(k + 1) % 3]]).cast<double>().norm();
    return sum / (3 * static_cast<double>(mesh.triangles.size()));
}

void need_cgal() {
    if (!have_tet_mesher())
        throw InvalidInput("Delaunay tetrahedra need CGAL, which this build does not have");
}

void check_range(const char* what, double value, double low, double high) {
    if (!(value >= low && value <= high))
        throw InvalidInput(fmt::format("{} is {:g}: {:g} to {:g} are possible", what, value, low, high));
}

}  // namespace

void DelaunayTetrahedraOptions::check() const {
    check_range("the facets' angle bound in degrees", facet_angle_deg, 0, 30);
    check_range("the facet size", facet_size, 0.01, 1e4);
    check_range("the facet distance", facet_distance, 0.001, 1e4);
    check_range("the cells' bound of radius over edge", cell_radius_edge, 1, 100);
    check_range("the cell size", cell_size, 0.01, 1e4);
    check_range("the sliver bound in degrees", sliver_bound_deg, 0.1, 40);
    if (max_vertices < 4 || max_vertices > TriMesh::max_vertices)
        throw InvalidInput(
            fmt::format("the bound on vertices is {}: 4 to 2^32 - 1 are possible", max_vertices));
    if (!(max_seconds > 0 && max_seconds <= 1e8))
        throw InvalidInput(
            fmt::format("the bound on time is {:g} s: above 0 and up to 1e8 are possible", max_seconds));
}

bool have_delaunay_tetrahedra() { return have_tet_mesher(); }

TetMesh delaunay_tetrahedra(const DensityMap& map, double isovalue, const DelaunayTetrahedraOptions& options,
                            const Progress& progress) {
    options.check();
    need_cgal();
    if (!map.frame.bounded() && map.grid->background() >= static_cast<float>(isovalue))
        throw InvalidInput(
            fmt::format("the map is at or above {:g} without end: the solid is not bounded", isovalue));
    MarchingCubesOptions cubes;
    cubes.isovalue = isovalue;
    const TriMesh surface = cap_border(marching_cubes(map, cubes, progress.part(0, 0.02)), map, isovalue,
                                       progress.part(0.02, 0.03));
    if (surface.empty())
        throw NumericalError(fmt::format("nothing of the map is at or above {:g}", isovalue));
    const MapDomain domain(map, isovalue);
    const Vec3d voxel = map.frame.voxel_size();
    const ReferenceBoundary reference = reference_of(surface, voxel.minCoeff());
    SeededTetOptions seeded = seeded_options(options, voxel.minCoeff());
    seeded.bounds.manifold = true;
    set_box(seeded.bounds, reference.points, voxel.sum());
    return seeded_tetrahedra(domain, reference, seeded, progress.part(0.03, 1));
}

TetMesh delaunay_tetrahedra_of_labels(const DensityMap& labels, const std::vector<std::int64_t>& wanted,
                                      const DelaunayTetrahedraOptions& options, const Progress& progress) {
    options.check();
    need_cgal();
    const LabelDomain domain(labels, wanted, precision * labels.frame.voxel_size().minCoeff(),
                             progress.part(0, 0.02));
    const Vec3d voxel = labels.frame.voxel_size();
    const ReferenceBoundary reference = domain.boundary();
    SeededTetOptions seeded = seeded_options(options, voxel.minCoeff());
    set_box(seeded.bounds, reference.points, voxel.sum());
    TetMesh mesh = seeded_tetrahedra(domain, reference, seeded, progress.part(0.02, 1));
    for (const std::int32_t label : domain.labels()) {
        if (mesh.regions.empty()
                ? label == 1
                : std::find(mesh.regions.begin(), mesh.regions.end(), label) != mesh.regions.end())
            continue;
        throw NumericalError(
            fmt::format("no tetrahedron of label {} was made: try smaller facet and cell sizes", label));
    }
    return mesh;
}

TetMesh delaunay_tetrahedra(const TriMesh& surface, const DelaunayTetrahedraOptions& options,
                            const Progress& progress) {
    options.check();
    need_cgal();
    if (surface.empty()) throw InvalidInput("Delaunay tetrahedra: the surface has no faces");
    const MeshMeasures measures = measure_mesh(surface, progress.part(0, 0.01));
    if (!measures.closed || measures.non_manifold_edges > 0)
        throw InvalidInput(
            fmt::format("Delaunay tetrahedra need a closed surface: it has {} boundary edges and {} "
                        "non-manifold edges; repair may mend that",
                        measures.boundary_edges, measures.non_manifold_edges));
    const double unit = mean_edge(surface);
    if (!(unit > 0 && std::isfinite(unit)))
        throw InvalidInput("Delaunay tetrahedra: the surface has no size");
    const ReferenceBoundary reference = reference_of(surface, 0.5 * unit);
    const MeshDomain domain(reference.points, reference.triangles, unit);
    SeededTetOptions seeded = seeded_options(options, unit);
    seeded.bounds.manifold = true;
    set_box(seeded.bounds, reference.points, unit);
    return seeded_tetrahedra(domain, reference, seeded, progress.part(0.01, 1));
}

}  // namespace vdbgeo
