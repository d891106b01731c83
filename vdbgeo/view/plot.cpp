#include "vdbgeo/view/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/plot_frame.h"
#include "vdbgeo/view/plot_legend.h"

namespace vdbgeo {
namespace {

constexpr double most_powers = 8;

/// Highest and lowest value that is drawn, and the largest x.
struct Extent {
    double x, low = std::numeric_limits<double>::infinity(), high = -low;
    bool empty() const { return low > high; }
};

bool drawn(double y, bool logarithmic) { return std::isfinite(y) && (!logarithmic || y > 0); }

Extent extent_of(const std::vector<Curve>& curves, bool logarithmic, double x_low) {
    Extent e{x_low};
    for (const Curve& curve : curves) {
        if (curve.x.size() != curve.y.size())
            throw InvalidInput(
                fmt::format("a curve has {} values of x and {} of y", curve.x.size(), curve.y.size()));
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (!std::isfinite(curve.x[i]) || curve.x[i] < x_low)
                throw InvalidInput(fmt::format("value {} of x is {}: it must be finite and not below {}", i,
                                               curve.x[i], x_low));
            e.x = std::max(e.x, curve.x[i]);
            if (!drawn(curve.y[i], logarithmic)) continue;
            e.low = std::min(e.low, curve.y[i]);
            e.high = std::max(e.high, curve.y[i]);
        }
    }
    return e;
}

/// The ends of the y axis; of a logarithmic one as logarithms.
void set_heights(PlotFrame& frame, const Extent& e, bool logarithmic) {
    if (logarithmic) {
        frame.y_high = e.empty() ? 1 : std::ceil(std::log10(e.high) + 0.02);
        frame.y_low =
            e.empty() ? 0 : std::max(std::floor(std::log10(e.low) - 0.02), frame.y_high - most_powers);
    } else {
        frame.y_low = e.empty() ? 0 : std::min(0.0, 1.05 * e.low);
        frame.y_high = e.empty() || !(e.high > 0) ? 1 : 1.05 * e.high;
    }
}

/// The curve in pixels: parted where there is no value, and where it runs below the axis.
std::vector<std::vector<Vec2d>> chains_of(const PlotFrame& frame, const Curve& curve, bool logarithmic) {
    std::vector<std::vector<Vec2d>> chains(1);
    bool last_below = false;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
        if (!drawn(curve.y[i], logarithmic)) {
            chains.emplace_back();
            continue;
        }
        const double y = logarithmic ? std::log10(curve.y[i]) : curve.y[i];
        const bool below = y < frame.y_low;
        if (below && last_below) chains.emplace_back();
        chains.back().emplace_back(frame.x(curve.x[i]), frame.y(std::max(y, frame.y_low)));
        last_below = below;
    }
    chains.erase(std::remove_if(chains.begin(), chains.end(), [](const auto& c) { return c.size() < 2; }),
                 chains.end());
    return chains;
}

/// The plot with its legend inside, or above where `above` says so; false where it does not fit inside.
bool draw_curves(Drawing& drawing, const std::vector<Curve>& curves, const Extent& extent, bool logarithmic,
                 const PlotOptions& options, bool above) {
    const double em = em_of(options);
    const Legend legend(curves, em);
    const double legend_width = options.width - 3.2 * em;
    const double labels = height_of_marks(options, em);
    const double room = labels + (above ? legend.height_above(legend_width) : 0);
    PlotFrame frame = frame_of(options, em, room);
    frame.x_low = options.x_low;
    frame.x_high = extent.x > options.x_low ? extent.x : options.x_low + 1;
    set_heights(frame, extent, logarithmic);
    const Ticks ys = logarithmic ? power_ticks(frame, em) : linear_ticks(frame, em);
    const Ticks xs = finish_frame(frame, ys, options, em);
    add_grid(drawing, frame, ys, options.theme);
    add_marks(drawing, frame, options, em);
    std::vector<std::vector<Vec2d>> all;
    for (const Curve& curve : curves) {
        const auto chains = chains_of(frame, curve, logarithmic);
        all.insert(all.end(), chains.begin(), chains.end());
        if (!chains.empty())
            drawing.shapes.push_back(
                Drawing::Lines{chains, std::max(1.5, 0.14 * em), curve.colour, Drawing::Role::own});
    }
    add_axes(drawing, frame, xs, ys, em, options.theme);
    add_words(drawing, frame, options, em, room);
    if (above) {
        legend.add_above(drawing, 1.6 * em, frame.top - room - 0.3 * em, legend_width, options.theme);
        return true;
    }
    for (const PlotMark& mark : options.marks)
        all.push_back({{frame.x(mark.value), frame.top}, {frame.x(mark.value), frame.bottom}});
    return legend.add_inside(drawing, frame, all, options.theme);
}

void check_histogram(const std::vector<double>& counts, double lo, double hi) {
    if (counts.empty()) throw InvalidInput("a histogram without counts cannot be drawn");
    if (!std::isfinite(lo) || !std::isfinite(hi) || !(lo < hi))
        throw InvalidInput(fmt::format("histogram range {} to {} is empty", lo, hi));
    for (std::size_t i = 0; i < counts.size(); ++i)
        if (!std::isfinite(counts[i]) || counts[i] < 0)
            throw InvalidInput(
                fmt::format("histogram count {} is {}: it must be finite and not negative", i, counts[i]));
}

/// A third of a power of ten below the least count, so that it has a bar too.
void set_powers(PlotFrame& frame, const std::vector<double>& counts) {
    double low = std::numeric_limits<double>::infinity(), high = 0;
    for (const double c : counts)
        if (c > 0) low = std::min(low, c), high = std::max(high, c);
    frame.y_high = high > 0 ? std::log10(high) + 0.15 : 1;
    frame.y_low = high > 0 ? std::max(std::floor(std::log10(low)) - 0.35, frame.y_high - most_powers) : -0.35;
    frame.y_high = std::max(frame.y_high, frame.y_low + 1.4);
}

}  // namespace

Drawing plot_histogram(const std::vector<double>& counts, double lo, double hi, const PlotOptions& options) {
    options.check();
    check_histogram(counts, lo, hi);
    Drawing drawing = empty_drawing(options);
    const double em = em_of(options), above = height_of_marks(options, em);
    PlotFrame frame = frame_of(options, em, above);
    frame.x_low = lo;
    frame.x_high = hi;
    const bool powers = options.logarithmic_counts;
    if (powers) {
        set_powers(frame, counts);
    } else {
        const double largest = *std::max_element(counts.begin(), counts.end());
        frame.y_high = largest > 0 ? 1.05 * largest : 1;
    }
    const Ticks ys = powers ? power_ticks(frame, em) : linear_ticks(frame, em);
    const Ticks xs = finish_frame(frame, ys, options, em);
    add_grid(drawing, frame, ys, options.theme);
    Drawing::Boxes bars{{}, options.bars};
    const double step = (hi - lo) / static_cast<double>(counts.size());
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const double x0 = frame.x(lo + static_cast<double>(i) * step),
                     x1 = frame.x(lo + static_cast<double>(i + 1) * step);
        const double slit = std::min(2.0, 0.12 * (x1 - x0));
        const double height = powers && counts[i] > 0 ? std::log10(counts[i]) : counts[i];
        if (counts[i] > 0 && height > frame.y_low)
            bars.boxes.push_back({x0 + slit / 2, frame.y(height), x1 - slit / 2, frame.bottom});
    }
    drawing.shapes.push_back(std::move(bars));
    add_marks(drawing, frame, options, em);
    add_axes(drawing, frame, xs, ys, em, options.theme);
    add_words(drawing, frame, options, em, above);
    return drawing;
}

Drawing plot_curves(const std::vector<Curve>& curves, bool logarithmic, const PlotOptions& options) {
    options.check();
    const Extent extent = extent_of(curves, logarithmic, options.x_low);
    Drawing inside = empty_drawing(options);
    if (draw_curves(inside, curves, extent, logarithmic, options, false)) return inside;
    PlotOptions taller = options;  // names without end need a page of their own
    const double em = em_of(options), rows = Legend(curves, em).height_above(options.width - 3.2 * em);
    if (rows > 0.3 * options.height)
        taller.height = static_cast<int>(std::min<double>(Image::max_side, options.height + rows));
    Drawing above = empty_drawing(taller);
    draw_curves(above, curves, extent, logarithmic, taller, true);
    return above;
}

}  // namespace vdbgeo
