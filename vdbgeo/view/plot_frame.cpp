#include "vdbgeo/view/plot_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

using Role = Drawing::Role;

void PlotOptions::check() const {
    for (const auto& [name, side] : {std::pair("width", width), std::pair("height", height)})
        if (side < 160 || side > Image::max_side)
            throw InvalidInput(
                fmt::format("{} of {} pixels is not in 160 to {}", name, side, Image::max_side));
    for (const PlotMark& mark : marks)
        if (!std::isfinite(mark.value))
            throw InvalidInput(fmt::format("a mark at {} is not finite", mark.value));
}

double em_of(const PlotOptions& options) {
    return std::max(10.0, std::min(options.width / 42.0, options.height / 24.0));
}

Drawing empty_drawing(const PlotOptions& options) {
    Drawing drawing;
    drawing.width = options.width;
    drawing.height = options.height;
    drawing.title = options.title;
    drawing.paper = options.theme.paper;
    return drawing;
}

PlotFrame frame_of(const PlotOptions& options, double em, double above) {
    PlotFrame frame{};
    frame.right = options.width - 1.6 * em;
    frame.top = (options.title.empty() ? 1.2 : 2.8) * em + above;
    frame.bottom = options.height - (options.x_label.empty() ? 2.2 : 3.6) * em;
    return frame;
}

Ticks finish_frame(PlotFrame& frame, const Ticks& ys, const PlotOptions& options, double em) {
    double widest = 0;
    for (const std::string& label : ys.labels) widest = std::max(widest, text_width(label, 0.95 * em));
    frame.left = (options.y_label.empty() ? 1.2 : 2.6) * em + widest;
    return make_ticks(frame.x_low, frame.x_high, std::max(2, static_cast<int>(frame.width() / (4.5 * em))));
}

Ticks linear_ticks(const PlotFrame& frame, double em) {
    return make_ticks(frame.y_low, frame.y_high, std::max(2, static_cast<int>(frame.height() / (3 * em))));
}

Ticks power_ticks(const PlotFrame& frame, double em) {
    Ticks ticks;
    const double first = std::ceil(frame.y_low), last = std::floor(frame.y_high);
    const double step = std::ceil((last - first + 1) * 1.6 * em / frame.height());
    for (double power = first; power <= last; power += std::max(1.0, step)) {
        ticks.values.push_back(power);
        ticks.labels.push_back(power_of_ten(static_cast<int>(power)));
    }
    return ticks;
}

double fitting_size(const std::string& text, double size, double room) {
    return std::min(size, text.empty() ? size : size * room / text_width(text, size));
}

void add_line(Drawing& drawing, const Vec2d& from, const Vec2d& to, double thickness, const Vec3f& colour,
              Role role) {
    drawing.shapes.push_back(Drawing::Lines{{{from, to}}, thickness, colour, role});
}

void add_text(Drawing& drawing, const Vec2d& position, const std::string& text, double size,
              const Theme& theme, TextAlign align, bool upwards) {
    if (!text.empty())
        drawing.shapes.push_back(Drawing::Text{position, text, size, theme.ink, align, upwards, Role::ink});
}

void add_grid(Drawing& drawing, const PlotFrame& frame, const Ticks& ys, const Theme& theme) {
    Drawing::Lines lines{{}, 1, theme.faint, Role::grid};
    for (const double value : ys.values)
        if (value != 0 || frame.y_low != 0)  // there is the axis
            lines.chains.push_back({{frame.left, frame.y(value)}, {frame.right, frame.y(value)}});
    drawing.shapes.push_back(std::move(lines));
}

void add_axes(Drawing& drawing, const PlotFrame& frame, const Ticks& xs, const Ticks& ys, double em,
              const Theme& theme) {
    Drawing::Lines lines{{}, std::max(1.0, 0.07 * em), theme.ink, Role::ink};
    lines.chains = {{{frame.left, frame.top}, {frame.left, frame.bottom}, {frame.right, frame.bottom}}};
    for (const double value : xs.values)
        lines.chains.push_back({{frame.x(value), frame.bottom}, {frame.x(value), frame.bottom + 0.3 * em}});
    for (const double value : ys.values)
        lines.chains.push_back({{frame.left - 0.3 * em, frame.y(value)}, {frame.left, frame.y(value)}});
    drawing.shapes.push_back(std::move(lines));
    for (std::size_t i = 0; i < xs.values.size(); ++i)
        add_text(drawing, {frame.x(xs.values[i]), frame.bottom + 1.3 * em}, xs.labels[i], 0.95 * em, theme,
                 TextAlign::centre);
    for (std::size_t i = 0; i < ys.values.size(); ++i)
        add_text(drawing, {frame.left - 0.5 * em, frame.y(ys.values[i]) + 0.33 * em}, ys.labels[i], 0.95 * em,
                 theme, TextAlign::right);
}

void add_words(Drawing& drawing, const PlotFrame& frame, const PlotOptions& options, double em,
               double above) {
    const double middle = (frame.left + frame.right) / 2;
    add_text(drawing, {middle, frame.top - 0.9 * em - above}, options.title,
             fitting_size(options.title, 1.15 * em, frame.width()), options.theme, TextAlign::centre);
    add_text(drawing, {middle, frame.bottom + 2.8 * em}, options.x_label,
             fitting_size(options.x_label, em, frame.width()), options.theme, TextAlign::centre);
    add_text(drawing, {1.3 * em, (frame.top + frame.bottom) / 2}, options.y_label,
             fitting_size(options.y_label, em, frame.height()), options.theme, TextAlign::centre, true);
}

double height_of_marks(const PlotOptions& options, double em) { return options.marks.empty() ? 0 : 1.5 * em; }

void add_marks(Drawing& drawing, const PlotFrame& frame, const PlotOptions& options, double em) {
    for (const PlotMark& mark : options.marks) {
        const double x = frame.x(mark.value);
        if (!(x >= frame.left && x <= frame.right)) continue;
        add_line(drawing, {x, frame.top - 0.3 * em}, {x, frame.bottom}, std::max(1.5, 0.1 * em),
                 options.theme.ink, Role::ink);
        const double size = fitting_size(mark.label, 0.95 * em, frame.width());
        const double half = text_width(mark.label, size) / 2;
        add_text(drawing, {std::clamp(x, frame.left + half, frame.right - half), frame.top - 0.65 * em},
                 mark.label, size, options.theme, TextAlign::centre);
    }
}

}  // namespace vdbgeo
