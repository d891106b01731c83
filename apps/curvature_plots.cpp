// The plots of a curvature report.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/curvature_report.h"
#include "vdbgeo/measure/curvature_plane.h"
#include "vdbgeo/measure/shape_types.h"
#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/plot.h"
#include "vdbgeo/view/plot_plane.h"

namespace vdbgeo::app {
namespace {

/// Bins of a histogram: 150 vertices a bin, were they even; with fewer a curve shows their number, not the
/// shape.
std::size_t bins_for(std::size_t vertices) { return std::clamp<std::size_t>(vertices / 150, 30, 120); }

/// Cells a side of the plane: four vertices a cell, were they even; else many would hold one or none.
std::size_t cells_for(std::size_t vertices) {
    return static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(vertices) / 4), 24.0, 104.0));
}

/// The area by value, in equal bins from low to high; what lies beyond is left out.
std::vector<double> area_in_bins(const Array<double>& values, const Array<double>& areas, std::size_t bins,
                                 double low, double high) {
    std::vector<double> area(bins, 0.0);
    for (std::size_t v = 0; v < values.size(); ++v)
        if (values[v] >= low && values[v] < high)
            area[std::min(bins - 1, static_cast<std::size_t>((values[v] - low) / (high - low) *
                                                             static_cast<double>(bins)))] += areas[v];
    return area;
}

/// Places for the names of the types, on a grid over the plane. A type that is a line in the plane (one of
/// its curvatures 0) has its name on it.
std::vector<PlaneName> type_names(double low, double high) {
    constexpr int steps = 60;
    const double step = (high - low) / steps;
    std::vector<PlaneName> names;
    for (const SurfaceType type :
         {SurfaceType::peak, SurfaceType::saddle_ridge, SurfaceType::saddle_valley, SurfaceType::pit}) {
        PlaneName name{name_of(type), {}, false};
        Vec2d middle = Vec2d::Zero();
        for (int y = 0; y <= steps; ++y)
            for (int x = y; x <= steps; ++x) {
                const Vec2d k(low + x * step, low + y * step);
                if (surface_type(k.x(), k.y(), 0) != type) continue;
                name.places.push_back(k);
                middle += k;
            }
        middle /= std::max<double>(1, static_cast<double>(name.places.size()));
        std::stable_sort(name.places.begin(), name.places.end(), [&](const Vec2d& a, const Vec2d& b) {
            return (a - middle).norm() < (b - middle).norm();
        });
        names.push_back(std::move(name));
    }
    PlaneName ridge{"ridge", {}, true}, valley{"valley", {}, true}, minimal{"minimal", {}, true},
        flat{"flat", {}, false};
    for (int i = steps; i > steps / 20; --i) {
        const double t = static_cast<double>(i) / steps;
        ridge.places.emplace_back(t * high, 0);
        valley.places.emplace_back(0, t * low);
        minimal.places.emplace_back(t * std::min(high, -low), -t * std::min(high, -low));
    }
    // Above the diagonal there is no surface: the origin's name stands there, as near as it can.
    for (int i = 1; i <= steps / 2; ++i) flat.places.emplace_back(-0.5 * i * step, 0.5 * i * step);
    for (PlaneName* name : {&ridge, &valley, &minimal, &flat}) names.push_back(std::move(*name));
    return names;
}

}  // namespace

Drawing plot_curvature_histogram(const CurvatureReport& r, const Theme& theme) {
    const Colormap colours("categorical");
    PlotOptions options;
    options.title = "Curvature over the surface";
    options.x_label = "curvature (1/Å)";
    options.y_label = "share of the area (% a bin)";
    options.theme = theme;
    const Curvatures& c = r.curvature;
    const std::size_t bins = bins_for(c.size());
    const Array<double> weights = as_weights(r.areas);
    // One axis for the three: from the least to the greatest of what 99 % of the area has.
    double low = 0, high = 0;
    for (const Array<double>* values : {&c.k1, &c.k2}) {
        const AreaHistogram h = area_histogram(*values, weights, bins);
        low = std::min(low, h.low);
        high = std::max(high, h.high);
    }
    if (!(low < high)) low = -1, high = 1;
    options.x_low = low;
    std::vector<Curve> curves;
    const std::pair<const char*, const Array<double>*> shown[] = {{"k1", &c.k1}, {"k2", &c.k2}, {"H", &c.H}};
    for (const auto& [name, values] : shown) {
        const std::vector<double> area = area_in_bins(*values, weights, bins, low, high);
        double all = 0;
        for (const double a : area) all += a;
        Curve curve{name, {}, {}, colours.category(static_cast<std::int64_t>(curves.size()))};
        for (std::size_t b = 0; b < bins; ++b) {
            curve.x.push_back(low +
                              (static_cast<double>(b) + 0.5) * (high - low) / static_cast<double>(bins));
            curve.y.push_back(all > 0 ? 100 * area[b] / all : 0);
        }
        curves.push_back(std::move(curve));
    }
    return plot_curves(curves, false, options);
}

Drawing plot_curvature_plane(const CurvatureReport& r, const Theme& theme) {
    const CurvaturePlane plane =
        curvature_plane(r.curvature, as_weights(r.areas), cells_for(r.curvature.size()));
    PlotOptions options;
    options.title = "Principal curvatures over the surface";
    options.x_label = "k1, the greater one (1/Å)";
    options.y_label = "k2, the smaller one (1/Å)";
    options.width = 800;
    options.theme = theme;
    PlaneDensity density{plane.side, plane.area, plane.low, plane.high};
    for (double& area : density.values) area = plane.all > 0 ? 100 * area / plane.all : 0;
    const double low = plane.low, high = plane.high, even = std::min(high, -low);
    PlanePlot plot;
    plot.lines = {{{low, low}, {high, high}},  // k1 = k2: there is nothing above
                  {{0, 0}, {high, 0}},         // k2 = 0
                  {{0, 0}, {0, low}},          // k1 = 0
                  {{0, 0}, {even, -even}}};    // H = 0
    plot.names = type_names(low, high);
    plot.bar_label = "share of the area (% a cell)";
    const double outside = plane.all > 0 ? 100 * plane.outside / plane.all : 0;
    if (outside > 0) plot.note = fmt::format("{:.2g} % of the area lies outside", outside);
    return plot_plane(density, plot, options);
}

}  // namespace vdbgeo::app
