#include "vdbgeo/view/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/text.h"
#include "vdbgeo/view/ticks.h"

namespace vdbgeo {
namespace {

const Vec3f ink = Vec3f::Constant(0.13f), faint = Vec3f::Constant(0.87f);

/// The rectangle inside the axes, and how values lie in it.
struct Frame2d {
    double left, right, top, bottom, x_low, x_high, y_high;
    double x(double value) const { return left + (value - x_low) / (x_high - x_low) * (right - left); }
    double y(double value) const { return bottom - value / y_high * (bottom - top); }
};

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
    const double em = std::max(10.0, std::min(options.width / 46.0, options.height / 24.0));
    const double largest = *std::max_element(counts.begin(), counts.end());
    Frame2d frame{0,
                  options.width - 1.6 * em,
                  (options.title.empty() ? 1.2 : 2.8) * em,
                  options.height - (options.x_label.empty() ? 2.2 : 3.6) * em,
                  lo,
                  hi,
                  largest > 0 ? 1.05 * largest : 1};
    const Ticks ys =
        make_ticks(0, frame.y_high, std::max(2, static_cast<int>((frame.bottom - frame.top) / (3 * em))));
    double widest = 0;
    for (const std::string& label : ys.labels) widest = std::max(widest, text_width(label, 0.95 * em));
    frame.left = (options.y_label.empty() ? 1.2 : 2.6) * em + widest;
    const Ticks xs =
        make_ticks(lo, hi, std::max(2, static_cast<int>((frame.right - frame.left) / (4.5 * em))));

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

}  // namespace vdbgeo
