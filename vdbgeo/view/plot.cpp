#include "vdbgeo/view/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/text.h"
#include "vdbgeo/view/ticks.h"

namespace vdbgeo {
namespace {

const Vec3f ink = Vec3f::Constant(0.13f), faint = Vec3f::Constant(0.87f);

/// The rectangle inside the axes, and how values lie in it.
struct Frame2d {
    double left, right, top, bottom, x_low, x_high, y_low, y_high;
    double x(double value) const { return left + (value - x_low) / (x_high - x_low) * (right - left); }
    double y(double value) const { return bottom - (value - y_low) / (y_high - y_low) * (bottom - top); }
};

double em_of(const PlotOptions& options) {
    return std::max(10.0, std::min(options.width / 46.0, options.height / 24.0));
}

/// The frame but for its left side, which waits for the labels beside it.
Frame2d frame_of(const PlotOptions& options, double em) {
    Frame2d frame{};
    frame.right = options.width - 1.6 * em;
    frame.top = (options.title.empty() ? 1.2 : 2.8) * em;
    frame.bottom = options.height - (options.x_label.empty() ? 2.2 : 3.6) * em;
    return frame;
}

/// Sets the left side; the ticks of the x axis.
Ticks finish_frame(Frame2d& frame, const Ticks& ys, const PlotOptions& options, double em) {
    double widest = 0;
    for (const std::string& label : ys.labels) widest = std::max(widest, text_width(label, 0.95 * em));
    frame.left = (options.y_label.empty() ? 1.2 : 2.6) * em + widest;
    return make_ticks(frame.x_low, frame.x_high,
                      std::max(2, static_cast<int>((frame.right - frame.left) / (4.5 * em))));
}

void draw_axes(Image& image, const Frame2d& frame, const Ticks& xs, const Ticks& ys, double em) {
    const double line = std::max(1.0, 0.07 * em);
    draw_segments(image,
                  {{{frame.left, frame.bottom}, {frame.right, frame.bottom}},
                   {{frame.left, frame.top}, {frame.left, frame.bottom}}},
                  line, ink);
    for (std::size_t i = 0; i < xs.values.size(); ++i) {
        const double x = frame.x(xs.values[i]);
        draw_line(image, {x, frame.bottom}, {x, frame.bottom + 0.3 * em}, line, ink);
        draw_text(image, {x, frame.bottom + 1.3 * em}, xs.labels[i], 0.95 * em, ink, TextAlign::centre);
    }
    for (std::size_t i = 0; i < ys.values.size(); ++i) {
        const double y = frame.y(ys.values[i]);
        draw_line(image, {frame.left - 0.3 * em, y}, {frame.left, y}, line, ink);
        draw_text(image, {frame.left - 0.5 * em, y + 0.33 * em}, ys.labels[i], 0.95 * em, ink,
                  TextAlign::right);
    }
}

void draw_words(Image& image, const Frame2d& frame, const PlotOptions& options, double em) {
    const auto fit = [](const std::string& text, double size, double room) {
        return std::min(size, text.empty() ? size : size * room / text_width(text, size));
    };
    const double across = frame.right - frame.left, up = frame.bottom - frame.top;
    draw_text(image, {(frame.left + frame.right) / 2, frame.top - 0.9 * em}, options.title,
              fit(options.title, 1.15 * em, across), ink, TextAlign::centre);
    draw_text(image, {(frame.left + frame.right) / 2, frame.bottom + 2.8 * em}, options.x_label,
              fit(options.x_label, em, across), ink, TextAlign::centre);
    draw_text(image, {1.3 * em, (frame.top + frame.bottom) / 2}, options.y_label,
              fit(options.y_label, em, up), ink, TextAlign::centre, true);
}

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

/// The y axis by powers of ten: its ends in the frame as logarithms, its ticks, and these as text.
Ticks logarithmic_axis(Frame2d& frame, const Extent& e) {
    constexpr double most = 8;
    frame.y_high = e.empty() ? 1 : std::ceil(std::log10(e.high) + 0.02);
    frame.y_low = e.empty() ? 0 : std::max(std::floor(std::log10(e.low) - 0.02), frame.y_high - most);
    Ticks ticks;
    for (double power = frame.y_low; power <= frame.y_high; power += 1) {
        ticks.values.push_back(power);
        ticks.labels.push_back(power_of_ten(static_cast<int>(power)));
    }
    return ticks;
}

Ticks linear_axis(Frame2d& frame, const Extent& e, double em) {
    frame.y_low = e.empty() ? 0 : std::min(0.0, 1.05 * e.low);
    frame.y_high = e.empty() || !(e.high > 0) ? 1 : 1.05 * e.high;
    return make_ticks(frame.y_low, frame.y_high,
                      std::max(2, static_cast<int>((frame.bottom - frame.top) / (3 * em))));
}

void draw_curve(Image& image, const Frame2d& frame, const Curve& curve, bool logarithmic, double em) {
    std::vector<Segment> segments;
    std::optional<Vec2d> last;
    bool last_below = false;  // the lowest value that the axis shows
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
        std::optional<Vec2d> here;
        bool below = false;
        if (drawn(curve.y[i], logarithmic)) {
            const double y = logarithmic ? std::log10(curve.y[i]) : curve.y[i];
            below = y < frame.y_low;
            here = Vec2d(frame.x(curve.x[i]), frame.y(std::max(y, frame.y_low)));
        }
        if (here && last && !(below && last_below)) segments.push_back({*last, *here});
        last = here;
        last_below = below;
    }
    draw_segments(image, segments, std::max(1.5, 0.14 * em), curve.colour);
}

void draw_legend(Image& image, const Frame2d& frame, const std::vector<Curve>& curves, double em) {
    double widest = 0, y = frame.top + 1.1 * em;
    for (const Curve& curve : curves) widest = std::max(widest, text_width(curve.name, em));
    const double left = frame.right - widest - em;
    for (const Curve& curve : curves) {
        if (curve.name.empty()) continue;
        draw_line(image, {left - 2.4 * em, y - 0.35 * em}, {left - 0.6 * em, y - 0.35 * em},
                  std::max(2.0, 0.2 * em), curve.colour);
        draw_text(image, {left, y}, curve.name, em, ink);
        y += 1.5 * em;
    }
}

}  // namespace

void PlotOptions::check() const {
    for (const auto& [name, side] : {std::pair("width", width), std::pair("height", height)})
        if (side < 160 || side > Image::max_side)
            throw InvalidInput(
                fmt::format("{} of {} pixels is not in 160 to {}", name, side, Image::max_side));
}

Image plot_histogram(const std::vector<double>& counts, double lo, double hi, const PlotOptions& options) {
    options.check();
    if (counts.empty()) throw InvalidInput("a histogram without counts cannot be drawn");
    if (!std::isfinite(lo) || !std::isfinite(hi) || !(lo < hi))
        throw InvalidInput(fmt::format("histogram range {} to {} is empty", lo, hi));
    for (std::size_t i = 0; i < counts.size(); ++i)
        if (!std::isfinite(counts[i]) || counts[i] < 0)
            throw InvalidInput(
                fmt::format("histogram count {} is {}: it must be finite and not negative", i, counts[i]));

    Image image(options.width, options.height);
    const double em = em_of(options);
    const double largest = *std::max_element(counts.begin(), counts.end());
    Frame2d frame = frame_of(options, em);
    frame.x_low = lo;
    frame.x_high = hi;
    frame.y_high = largest > 0 ? 1.05 * largest : 1;
    const Ticks ys =
        make_ticks(0, frame.y_high, std::max(2, static_cast<int>((frame.bottom - frame.top) / (3 * em))));
    const Ticks xs = finish_frame(frame, ys, options, em);

    for (const double value : ys.values)
        if (value > 0)
            draw_line(image, {frame.left, frame.y(value)}, {frame.right, frame.y(value)}, 1, faint);
    const double step = (hi - lo) / static_cast<double>(counts.size());
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const double x0 = frame.x(lo + static_cast<double>(i) * step),
                     x1 = frame.x(lo + static_cast<double>(i + 1) * step);
        const double slit = std::min(2.0, 0.12 * (x1 - x0));
        if (counts[i] > 0)
            fill_rectangle(image, x0 + slit / 2, frame.y(counts[i]), x1 - slit / 2, frame.bottom,
                           options.bars);
    }
    draw_axes(image, frame, xs, ys, em);
    draw_words(image, frame, options, em);
    return image;
}

Image plot_curves(const std::vector<Curve>& curves, bool logarithmic, const PlotOptions& options) {
    options.check();
    const Extent extent = extent_of(curves, logarithmic, options.x_low);
    Image image(options.width, options.height);
    const double em = em_of(options);
    Frame2d frame = frame_of(options, em);
    frame.x_low = options.x_low;
    frame.x_high = extent.x > options.x_low ? extent.x : options.x_low + 1;
    const Ticks ys = logarithmic ? logarithmic_axis(frame, extent) : linear_axis(frame, extent, em);
    const Ticks xs = finish_frame(frame, ys, options, em);
    for (const double value : ys.values)
        draw_line(image, {frame.left, frame.y(value)}, {frame.right, frame.y(value)}, 1, faint);
    for (const Curve& curve : curves) draw_curve(image, frame, curve, logarithmic, em);
    draw_axes(image, frame, xs, ys, em);
    draw_words(image, frame, options, em);
    draw_legend(image, frame, curves, em);
    return image;
}

}  // namespace vdbgeo
