#include "apps/validate_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/stages.h"
#include "vdbgeo/measure/adaptive_curvature.h"
#include "vdbgeo/measure/analytic_patches.h"
#include "vdbgeo/measure/discrete_curvature.h"
#include "vdbgeo/measure/field_curvature.h"
#include "vdbgeo/measure/jet_curvature.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/remesh/isotropic_remesh.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/volume/phantom.h"

namespace vdbgeo::app {
namespace {

/// A figure of the paper is known to half of its last digit.
constexpr double half_digit_area = 0.005, half_digit_curvature = 5e-7;
/// Orders that a second-order method has to show: of root mean squares, and of largest errors.
constexpr double least_order = 1.95, least_order_largest = 1.9;
/// Errors below this (in 1/Å or 1/Å²) are of the rounding of points to 32-bit floats: their order tells
/// nothing.
constexpr double rounding_floor = 3e-6;

const std::vector<double> edges{0.1, 0.05, 0.025, 0.0125};

std::string radius_name(int squared) {
    return squared == 1 ? "radius 1" : fmt::format("radius √{}", squared);
}

// ---- Tables 2 to 4: spheres

struct SphereFigures {
    int squared_radius;
    double area, volume;
    int frequency;  ///< of the geodesic sphere: its area is at most as far from the sphere's as the paper's
    double barycentric[4];  ///< Table 3: mean and spread of K, of H
    double voronoi[4];      ///< Table 4
};

const SphereFigures spheres[] = {
    {1, 12.53, 4.16, 10, {1.003239, 0.026352, 1.000031, 0.018632}, {1.003238, 0.010534, 1.000030, 0.002627}},
    {2, 25.09, 11.81, 14, {0.500804, 0.011344, 0.707106, 0.011323}, {0.500804, 0.007382, 0.707107, 0.003701}},
    {3,
     37.66,
     21.72,
     18,
     {0.333685, 0.009292, 0.577343, 0.010881},
     {0.333684, 0.007158, 0.577343, 0.005481}}};

/// As near to the theory as the paper is, its figure being rounded by `half_digit`.
ValidatedValue near_theory(const std::string& name, double ours, double paper, double theory,
                           double half_digit) {
    ValidatedValue v{name, ours, paper, theory, {}, {}, ""};
    const double allowed = std::abs(paper - theory) + half_digit;
    if (!(std::abs(ours - theory) <= allowed))
        v.fault = fmt::format("off by {:.3g}, the paper by {:.3g}", ours - theory, paper - theory);
    return v;
}

ValidatedValue at_most(const std::string& name, double ours, double paper, double half_digit) {
    ValidatedValue v{name, ours, paper, {}, {}, {}, ""};
    if (!(ours <= paper + half_digit)) v.fault = fmt::format("{:.4g}, the paper {:.4g}", ours, paper);
    return v;
}

DensityMap sphere_map(double radius, double spacing) {
    PhantomOptions options;
    options.kind = "sphere";
    options.size = static_cast<int>(std::ceil(2 * radius / spacing)) + 4;
    options.voxel_size = spacing;
    options.radius = radius;
    return phantom_map(Phantom(options), false, {});
}

ValidatedTable table_2() {
    ValidatedTable table{"2", "areas and volumes of spheres; marching cubes of maps sampled every 0.1 Å", {}};
    for (const SphereFigures& s : spheres) {
        const double r = std::sqrt(s.squared_radius), area = 4 * M_PI * r * r;
        const MeshMeasures m = measure_mesh(marching_cubes(sphere_map(r, 0.1), {0}));
        table.rows.push_back(
            {radius_name(s.squared_radius),
             "",
             {near_theory("area", m.area_A2, s.area, area, half_digit_area),
              near_theory("volume", m.volume_A3.value_or(0), s.volume, area * r / 3, half_digit_area)}});
    }
    return table;
}

struct Spread {
    double mean = 0, deviation = 0;
};

/// Weighted by the dual areas; by equal weights where there are none.
Spread spread(const Array<double>& values, const Array<double>& areas) {
    double total = 0, mean = 0, square = 0;
    const auto weight = [&](std::size_t v) { return areas.empty() ? 1 : areas[v]; };
    for (std::size_t v = 0; v < values.size(); ++v) {
        total += weight(v);
        mean += weight(v) * values[v];
    }
    mean /= total;
    for (std::size_t v = 0; v < values.size(); ++v)
        square += weight(v) * (values[v] - mean) * (values[v] - mean);
    return {mean, std::sqrt(square / total)};
}

ValidatedTable table_3_or_4(bool voronoi) {
    ValidatedTable table{
        voronoi ? "4" : "3",
        fmt::format("curvature of spheres, {} areas; geodesic spheres with edges of 0.12 Å, as "
                    "the paper's areas tell; means weighted by area",
                    voronoi ? "Voronoi" : "barycentric"),
        {}};
    for (const SphereFigures& s : spheres) {
        const double r = std::sqrt(s.squared_radius);
        const double* paper = voronoi ? s.voronoi : s.barycentric;
        DiscreteCurvatureOptions options;
        options.area = voronoi ? DualArea::voronoi : DualArea::barycentric;
        const DiscreteCurvature c = discrete_curvature(geodesic_sphere(r, s.frequency), options);
        const Spread k = spread(c.K, c.dual_area), h = spread(c.H, c.dual_area);
        table.rows.push_back({radius_name(s.squared_radius),
                              voronoi ? "one ring, Voronoi" : "one ring, barycentric",
                              {near_theory("K mean", k.mean, paper[0], 1 / (r * r), half_digit_curvature),
                               at_most("K spread", k.deviation, paper[1], half_digit_curvature),
                               near_theory("H mean", h.mean, paper[2], 1 / r, half_digit_curvature),
                               at_most("H spread", h.deviation, paper[3], half_digit_curvature)}});
    }
    return table;
}

// ---- Tables 5 and 6, and the patches of the other types

/// One error norm of Tables 5 and 6 at the four edge lengths.
struct Norm {
    const char* name;
    double CurvatureErrors::*error;
    bool gaussian, largest;
    double paper[4], paper_order[4];
};
const Norm norms[] = {{"K L∞",
                       &CurvatureErrors::K_max,
                       true,
                       true,
                       {8.325e-3, 2.676e-3, 1.031e-3, 4.544e-4},
                       {0, 1.64, 1.38, 1.18}},
                      {"K L2",
                       &CurvatureErrors::K_rms,
                       true,
                       false,
                       {4.815e-3, 1.149e-3, 2.803e-4, 6.920e-5},
                       {0, 2.07, 2.04, 2.02}},
                      {"H L∞",
                       &CurvatureErrors::H_max,
                       false,
                       true,
                       {1.275e-3, 3.441e-4, 8.820e-5, 2.226e-5},
                       {0, 1.89, 1.96, 1.99}},
                      {"H L2",
                       &CurvatureErrors::H_rms,
                       false,
                       false,
                       {5.228e-4, 1.409e-4, 3.623e-5, 9.167e-6},
                       {0, 1.89, 1.96, 1.98}}};

enum class Method { voronoi, jets, field, adaptive };
constexpr Method methods[] = {Method::voronoi, Method::jets, Method::field, Method::adaptive};

std::string name_of(Method method) {
    switch (method) {
        case Method::voronoi:
            return "one ring, Voronoi";
        case Method::jets:
            return "jets, degree 4, 3 rings";
        case Method::field:
            return "field, scale 1 voxel";
        case Method::adaptive:
            return "adaptive (the default)";
    }
    return "";
}

CurvatureErrors errors_of(Method method, const AnalyticPatch& patch, const AnalyticPatchOptions& options) {
    switch (method) {
        case Method::voronoi: {
            DiscreteCurvatureOptions o;
            o.area = DualArea::voronoi;
            return curvature_errors(patch, discrete_curvature(patch.mesh, o));
        }
        case Method::jets: {
            JetOptions o;
            o.degree = 4;
            o.rings = 3;
            return curvature_errors(patch, jet_curvature(patch.mesh, o));
        }
        case Method::field: {
            FieldCurvatureOptions o;
            o.scale = 1;
            const DensityMap map = patch_map(options.shape, options.max_edge, options.radius);
            return curvature_errors(patch, field_curvature(patch.mesh, map, o));
        }
        case Method::adaptive:
            return curvature_errors(patch, adaptive_curvature(patch.mesh));
    }
    return {};
}

/// Part of an edge that vertices are moved by, where rings are uneven.
constexpr double uneven = 0.2;

/// The paper's sphere was meshed unevenly: on a sphere with even rings H by Eq 15 has no error of its order.
double jitter_of(PatchShape shape) {
    return shape == PatchShape::peak || shape == PatchShape::pit ? uneven : 0;
}

/// What is asked of a method beside being shown: errors of at most the paper's, orders of root mean squares,
/// and both of the largest error of K.
struct Bars {
    bool errors = false, l2_order = false, largest_K = false;
};

/// The field's errors are those of its gaussian, of second order too, but larger: shown, not judged.
Bars bars_of(Method method) {
    switch (method) {
        case Method::voronoi:
            return {true, true, false};
        case Method::jets:
            return {false, true, true};
        case Method::field:
        case Method::adaptive:
            return {};
    }
    return {};
}

struct Series {
    PatchShape shape;
    double jitter;
    Method method;
    Bars bars;
};

/// Which numbers of a series a table shows.
struct Shown {
    bool K = true, H = true, paper = false;
};

/// What is wrong with an error of this size and order; empty: nothing.
std::string fault_of(const Norm& norm, const Bars& bars, double limit, double ours,
                     std::optional<double> order) {
    const bool largest_K = norm.largest && norm.gaussian;
    if ((bars.errors || (bars.largest_K && largest_K)) && !(ours <= limit))
        return fmt::format("{:.4g}, the paper {:.4g}", ours, limit);
    double bar = 0;
    if (bars.l2_order && !norm.largest) bar = least_order;
    if (bars.largest_K && largest_K) bar = least_order_largest;
    if (bar > 0 && order && ours > rounding_floor && !(*order >= bar))
        return fmt::format("of order {:.2f}, below {}", *order, bar);
    return "";
}

/// The rows of a series, one an edge length.
void add_series(ValidatedTable& table, const Series& s, std::size_t levels, const Shown& shown) {
    CurvatureErrors before;
    for (std::size_t level = 0; level < levels; ++level) {
        AnalyticPatchOptions options;
        options.shape = s.shape;
        options.max_edge = edges[level];
        options.jitter = s.jitter;
        const CurvatureErrors e = errors_of(s.method, analytic_patch(options), options);
        ValidatedRow row{fmt::format("{}, edges {}", name_of(s.shape), edges[level]), name_of(s.method), {}};
        for (const Norm& norm : norms) {
            if (!(norm.gaussian ? shown.K : shown.H)) continue;
            ValidatedValue v;
            v.name = norm.name;
            v.ours = e.*norm.error;
            if (level > 0) v.order = std::log2(before.*norm.error / v.ours);
            if (shown.paper) v.paper = norm.paper[level];
            if (shown.paper && level > 0) v.paper_order = norm.paper_order[level];
            v.fault = fault_of(norm, s.bars, norm.paper[level], v.ours, v.order);
            row.values.push_back(std::move(v));
        }
        table.rows.push_back(std::move(row));
        before = e;
    }
}

void add_all(ValidatedTable& table, const std::vector<Series>& all, std::size_t levels, const Shown& shown,
             const Progress& progress) {
    for (std::size_t k = 0; k < all.size(); ++k) {
        progress.report(static_cast<double>(k) / static_cast<double>(all.size()));
        add_series(table, all[k], levels, shown);
    }
}

ValidatedTable table_5_or_6(bool gaussian, std::size_t levels, const Progress& progress) {
    ValidatedTable table{
        gaussian ? "5" : "6",
        fmt::format(
            "{} curvature on a patch of the unit sphere, against the longest edge in Å; errors and, in "
            "brackets, orders",
            gaussian ? "Gaussian" : "mean"),
        {}};
    std::vector<Series> all;
    for (const Method method : methods)
        all.push_back({PatchShape::peak, jitter_of(PatchShape::peak), method, bars_of(method)});
    add_all(table, all, levels, {gaussian, !gaussian, true}, progress);
    return table;
}

ValidatedTable patches_table(std::size_t levels, const Progress& progress) {
    ValidatedTable table{"patches", "patches of the other types; held against Tables 5 and 6", {}};
    std::vector<Series> all;
    for (const PatchShape shape :
         {PatchShape::pit, PatchShape::saddle_ridge, PatchShape::saddle_valley, PatchShape::minimal,
          PatchShape::torus_outside, PatchShape::torus_inside, PatchShape::ridge, PatchShape::valley})
        for (const Method method : methods) all.push_back({shape, jitter_of(shape), method, bars_of(method)});
    add_all(table, all, levels, {}, progress);
    return table;
}

/// Where the one-ring formulas do not converge: they are shown, the jets judged.
ValidatedTable irregular_table(std::size_t levels, const Progress& progress) {
    ValidatedTable table{
        "irregular", "patches with uneven rings, where one-ring formulas do not converge", {}};
    std::vector<Series> all;
    for (const PatchShape shape : {PatchShape::saddle_ridge, PatchShape::minimal, PatchShape::torus_inside})
        for (const Method method : methods)
            all.push_back({shape, uneven, method, method == Method::voronoi ? Bars{} : bars_of(method)});
    add_all(table, all, levels, {}, progress);
    return table;
}

/// What a user gets: a map, marching cubes, even triangles, curvature.
ValidatedTable maps_table(bool quick, const Progress& progress) {
    ValidatedTable table{
        "maps",
        "spheres from maps sampled every 0.05 Å, marching cubes, remeshed to edges of 0.12 Å; means "
        "weighted by area",
        {}};
    for (const SphereFigures& s : spheres) {
        if (quick && s.squared_radius > 1) break;
        const double r = std::sqrt(s.squared_radius);
        progress.report(0.3 * (s.squared_radius - 1));
        const DensityMap map = sphere_map(r, 0.05);
        IsotropicRemeshOptions remesh;
        remesh.target_length = 0.12;
        const TriMesh mesh = isotropic_remesh(marching_cubes(map, {0}), remesh);
        const DiscreteCurvature voronoi = discrete_curvature(mesh, {DualArea::voronoi});
        const auto add = [&](const std::string& method, const Curvatures& c) {
            const Spread k = spread(c.K, voronoi.dual_area), h = spread(c.H, voronoi.dual_area);
            const auto value = [](const char* name, double ours, std::optional<double> theory) {
                return ValidatedValue{name, ours, {}, theory, {}, {}, ""};
            };
            table.rows.push_back({radius_name(s.squared_radius),
                                  method,
                                  {value("K mean", k.mean, 1 / (r * r)), value("K spread", k.deviation, {}),
                                   value("H mean", h.mean, 1 / r), value("H spread", h.deviation, {})}});
        };
        add("one ring, Voronoi", voronoi);
        add("adaptive (the default)", adaptive_curvature(mesh));
        add("field, chosen scale", field_curvature(mesh, map));
    }
    return table;
}

}  // namespace

std::vector<std::string> validated_names() {
    return {"2", "3", "4", "5", "6", "patches", "irregular", "maps"};
}

ValidatedTable validated_table(const std::string& name, bool quick, const Progress& progress) {
    progress.report(0);
    const std::size_t levels = quick ? edges.size() - 1 : edges.size();
    if (name == "2") return table_2();
    if (name == "3" || name == "4") return table_3_or_4(name == "4");
    if (name == "5" || name == "6") return table_5_or_6(name == "5", levels, progress);
    if (name == "patches") return patches_table(levels, progress);
    if (name == "irregular") return irregular_table(levels, progress);
    if (name == "maps") return maps_table(quick, progress);
    throw InvalidInput(fmt::format("no table {}", name));
}

}  // namespace vdbgeo::app
