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
    int frequency;          ///< of the geodesic sphere, whose edges are 0.124 Å at most in root mean square
    double barycentric[4];  ///< Table 3: mean and spread of K, of H
    double voronoi[4];      ///< Table 4
};

const SphereFigures spheres[] = {
    {1, 12.53, 4.16, 10, {1.003239, 0.026352, 1.000031, 0.018632}, {1.003238, 0.010534, 1.000030, 0.002627}},
    {2, 25.09, 11.81, 14, {0.500804, 0.011344, 0.707106, 0.011323}, {0.500804, 0.007382, 0.707107, 0.003701}},
    {3,
     37.66,
     21.72,
     17,
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

/// Tables 5 and 6 at the four edge lengths.
struct PatchFigures {
    double largest[4], largest_order[4], l2[4], l2_order[4];
};
const PatchFigures paper_K{{8.325e-3, 2.676e-3, 1.031e-3, 4.544e-4},
                           {0, 1.64, 1.38, 1.18},
                           {4.815e-3, 1.149e-3, 2.803e-4, 6.920e-5},
                           {0, 2.07, 2.04, 2.02}};
const PatchFigures paper_H{{1.275e-3, 3.441e-4, 8.820e-5, 2.226e-5},
                           {0, 1.89, 1.96, 1.99},
                           {5.228e-4, 1.409e-4, 3.623e-5, 9.167e-6},
                           {0, 1.89, 1.96, 1.98}};

enum class Method { voronoi, jets, field, adaptive };

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
            break;
    }
    return {};
}

/// The paper meshed its sphere unevenly: its errors of H, which on a sphere come from uneven rings alone,
/// tell.
double jitter_of(PatchShape shape) { return shape == PatchShape::peak || shape == PatchShape::pit ? 0.2 : 0; }

/// What is asked of a method: errors of the paper's size, and orders.
struct Bars {
    bool errors = true, l2_order = true, largest_K_order = false;
};

Bars bars_of(Method method) {
    switch (method) {
        case Method::voronoi:
            return {true, true, false};
        case Method::jets:
            return {true, true, true};
        case Method::field:
            return {false, true, false};
        case Method::adaptive:
            return {false, false, false};
    }
    return {};
}

struct Series {
    PatchShape shape;
    double jitter;
    Method method;
    Bars bars;
};

/// One error with its order and, where the series is to be judged, its faults.
ValidatedValue judged(const std::string& name, double ours, const double* before, bool hold_error,
                      double limit, std::optional<double> order_bar) {
    ValidatedValue v{name, ours, {}, {}, {}, {}, ""};
    if (before) v.order = std::log2(*before / ours);
    if (hold_error && !(ours <= limit))
        v.fault = fmt::format("{:.4g}, the paper {:.4g}", ours, limit);
    else if (v.order && order_bar && ours > rounding_floor && !(*v.order >= *order_bar))
        v.fault = fmt::format("of order {:.2f}, below {}", *v.order, *order_bar);
    return v;
}

/// The rows of a series, one an edge length; `with_paper` shows the paper's figures beside.
void add_series(ValidatedTable& table, const Series& s, std::size_t levels, bool K, bool H, bool with_paper) {
    CurvatureErrors before;
    for (std::size_t level = 0; level < levels; ++level) {
        AnalyticPatchOptions options;
        options.shape = s.shape;
        options.max_edge = edges[level];
        options.jitter = s.jitter;
        const CurvatureErrors e = errors_of(s.method, analytic_patch(options), options);
        ValidatedRow row{fmt::format("{}, edges {}", name_of(s.shape), edges[level]), name_of(s.method), {}};
        const auto add = [&](const char* name, const PatchFigures& paper, bool largest,
                             double CurvatureErrors::*of, bool order_held) {
            ValidatedValue v =
                judged(name, e.*of, level > 0 ? &(before.*of) : nullptr, s.bars.errors,
                       largest ? paper.largest[level] : paper.l2[level],
                       order_held ? std::optional<double>(largest ? least_order_largest : least_order)
                                  : std::nullopt);
            if (with_paper) {
                v.paper = largest ? paper.largest[level] : paper.l2[level];
                if (level > 0) v.paper_order = largest ? paper.largest_order[level] : paper.l2_order[level];
            }
            row.values.push_back(std::move(v));
        };
        if (K) add("K L∞", paper_K, true, &CurvatureErrors::K_max, s.bars.largest_K_order);
        if (K) add("K L2", paper_K, false, &CurvatureErrors::K_rms, s.bars.l2_order);
        if (H) add("H L∞", paper_H, true, &CurvatureErrors::H_max, false);
        if (H) add("H L2", paper_H, false, &CurvatureErrors::H_rms, s.bars.l2_order);
        table.rows.push_back(std::move(row));
        before = e;
    }
}

ValidatedTable table_5_or_6(bool gaussian, std::size_t levels) {
    ValidatedTable table{
        gaussian ? "5" : "6",
        fmt::format("{} curvature on a patch of the unit sphere, against the longest edge (Å)",
                    gaussian ? "Gaussian" : "mean"),
        {}};
    for (const Method method : {Method::voronoi, Method::jets, Method::field})
        add_series(table, {PatchShape::peak, jitter_of(PatchShape::peak), method, bars_of(method)}, levels,
                   gaussian, !gaussian, true);
    return table;
}

ValidatedTable patches_table(std::size_t levels) {
    ValidatedTable table{"patches", "patches of the other types; held against Tables 5 and 6", {}};
    for (const PatchShape shape :
         {PatchShape::pit, PatchShape::saddle_ridge, PatchShape::saddle_valley, PatchShape::minimal,
          PatchShape::torus_outside, PatchShape::torus_inside, PatchShape::ridge, PatchShape::valley})
        for (const Method method : {Method::voronoi, Method::jets, Method::field})
            add_series(table, {shape, jitter_of(shape), method, bars_of(method)}, levels, true, true, false);
    return table;
}

/// Where the one-ring formulas do not converge: shown, not judged, but for the jets.
ValidatedTable irregular_table(std::size_t levels) {
    ValidatedTable table{
        "irregular", "the same patches from uneven rings: one-ring formulas do not converge there", {}};
    for (const PatchShape shape : {PatchShape::saddle_ridge, PatchShape::minimal, PatchShape::torus_inside})
        for (const Method method : {Method::voronoi, Method::jets}) {
            const Bars bars = method == Method::jets ? bars_of(method) : Bars{false, false, false};
            add_series(table, {shape, 0.2, method, bars}, levels, true, true, false);
        }
    return table;
}

/// What a user gets: a map, marching cubes, even triangles, curvature.
ValidatedTable maps_table(bool quick) {
    ValidatedTable table{
        "maps",
        "spheres from maps sampled every 0.05 Å, marching cubes, remeshed to edges of 0.12 Å; means "
        "weighted by area",
        {}};
    for (const SphereFigures& s : spheres) {
        if (quick && s.squared_radius > 1) break;
        const double r = std::sqrt(s.squared_radius);
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
    if (name == "5" || name == "6") return table_5_or_6(name == "5", levels);
    if (name == "patches") return patches_table(levels);
    if (name == "irregular") return irregular_table(levels);
    if (name == "maps") return maps_table(quick);
    throw InvalidInput(fmt::format("no table {}", name));
}

}  // namespace vdbgeo::app
