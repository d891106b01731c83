#include "vdbgeo/view/plot_plane.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/plot_frame.h"

namespace vdbgeo {
namespace {

using Box = Drawing::Boxes::Box;
using Role = Drawing::Role;

/// Colours between which no difference is seen; cells of one are one shape.
constexpr int shades = 48;
/// The palest end of the colour map would be lost on paper.
constexpr double palest = 0.93;

void check_plane(const PlaneDensity& density, const PlanePlot& plane) {
    if (density.side < 1 || density.values.size() != density.side * density.side)
        throw InvalidInput(
            fmt::format("{} values for a plane of {} cells a side", density.values.size(), density.side));
    if (!std::isfinite(density.low) || !std::isfinite(density.high) || !(density.low < density.high))
        throw InvalidInput(fmt::format("plane from {} to {} is empty", density.low, density.high));
    for (const double v : density.values)
        if (!std::isfinite(v) || v < 0)
            throw InvalidInput(
                fmt::format("a cell of the plane has {}: it must be finite and not negative", v));
    if (!(plane.powers >= 0.5 && plane.powers <= 12))
        throw InvalidInput(fmt::format("{} powers of ten are not 0.5 to 12", plane.powers));
}

/// From a value to a shade: logarithmic, the greatest value has the last one.
struct Shading {
    double highest, powers;  ///< highest as a power of ten
    int of(double value) const {
        const double t = 1 + (std::log10(value) - highest) / powers;
        return std::clamp(static_cast<int>(t * shades), 0, shades - 1);
    }
};

Vec3f colour_of(const Colormap& map, int shade) { return map.colour(palest * (shade + 0.5) / shades); }

void add_cells(Drawing& drawing, const PlaneDensity& density, const PlotFrame& frame, const Colormap& map,
               const Shading& shading) {
    std::vector<std::vector<Box>> cells(shades);
    const double step = (density.high - density.low) / static_cast<double>(density.side);
    // Edges at whole pixels: no seams between neighbours.
    const auto edge_x = [&](std::size_t i) {
        return std::round(frame.x(density.low + static_cast<double>(i) * step));
    };
    const auto edge_y = [&](std::size_t i) {
        return std::round(frame.y(density.low + static_cast<double>(i) * step));
    };
    for (std::size_t y = 0; y < density.side; ++y)
        for (std::size_t x = 0; x < density.side; ++x) {
            const double value = density.values[y * density.side + x];
            if (value > 0)
                cells[static_cast<std::size_t>(shading.of(value))].push_back(
                    {edge_x(x), edge_y(y + 1), edge_x(x + 1), edge_y(y)});
        }
    for (int s = 0; s < shades; ++s) {
        auto& boxes = cells[static_cast<std::size_t>(s)];
        if (!boxes.empty())
            drawing.shapes.push_back(Drawing::Boxes{std::move(boxes), colour_of(map, s), Role::own, 1});
    }
}

void add_bar(Drawing& drawing, const PlotFrame& frame, const Colormap& map, const Shading& shading,
             const std::string& label, double em, const Theme& theme) {
    PlotFrame bar = frame;
    bar.left = std::round(frame.right + 1.6 * em);
    bar.right = bar.left + std::round(0.9 * em);
    bar.y_high = shading.highest;
    bar.y_low = shading.highest - shading.powers;
    const double step = bar.height() / shades;
    for (int s = 0; s < shades; ++s)
        drawing.shapes.push_back(Drawing::Boxes{{{bar.left, std::round(bar.bottom - (s + 1) * step),
                                                  bar.right, std::round(bar.bottom - s * step)}},
                                                colour_of(map, s),
                                                Role::own,
                                                1});
    const Ticks ticks = power_ticks(bar, em);
    Drawing::Lines lines{{}, std::max(1.0, 0.07 * em), theme.ink, Role::ink};
    lines.chains.push_back({{bar.left, bar.top},
                            {bar.right, bar.top},
                            {bar.right, bar.bottom},
                            {bar.left, bar.bottom},
                            {bar.left, bar.top}});
    double widest = 0;
    for (std::size_t i = 0; i < ticks.values.size(); ++i) {
        const double y = bar.y(ticks.values[i]);
        lines.chains.push_back({{bar.right, y}, {bar.right + 0.3 * em, y}});
        add_text(drawing, {bar.right + 0.5 * em, y + 0.33 * em}, ticks.labels[i], 0.95 * em, theme);
        widest = std::max(widest, text_width(ticks.labels[i], 0.95 * em));
    }
    drawing.shapes.push_back(std::move(lines));
    add_text(drawing, {bar.right + widest + 1.6 * em, (bar.top + bar.bottom) / 2}, label,
             fitting_size(label, em, bar.height()), theme, TextAlign::centre, true);
}

bool overlap(const Box& a, const Box& b) { return a.x0 < b.x1 && b.x0 < a.x1 && a.y0 < b.y1 && b.y0 < a.y1; }

/// Whether the line, walked in steps smaller than the words are high, meets the box.
bool meets(const Box& box, const Vec2d& a, const Vec2d& b) {
    const int steps = 1 + static_cast<int>((b - a).norm() / (0.25 * (box.y1 - box.y0)));
    for (int i = 0; i <= steps; ++i) {
        const Vec2d p = a + (b - a) * i / steps;
        if (p.x() > box.x0 && p.x() < box.x1 && p.y() > box.y0 && p.y() < box.y1) return true;
    }
    return false;
}

/// Finds places for the names, one after the other.
class Names {
 public:
    Names(const PlaneDensity& density, const PlotFrame& frame, const std::vector<PlaneLine>& lines, double em)
        : density_(density), frame_(frame), lines_(lines), em_(em) {}

    void add(Drawing& drawing, const PlaneName& name, const Theme& theme) {
        const double size = 0.95 * em_, half = text_width(name.text, size) / 2 + 0.1 * em_;
        double least = std::numeric_limits<double>::infinity();
        Box best{};
        for (const Vec2d& place : name.places) {
            const double x = frame_.x(place.x()), y = frame_.y(place.y());
            const Box box{x - half, y - 0.6 * em_, x + half, y + 0.6 * em_};
            if (!allowed(box, name.across)) continue;
            const double hidden = covered(box);
            if (hidden < least) least = hidden, best = box;
        }
        if (!std::isfinite(least)) return;
        taken_.push_back(best);
        if (least > 0 || name.across)
            drawing.shapes.push_back(Drawing::Boxes{{best}, theme.paper, Role::paper, 0.75});
        add_text(drawing, {(best.x0 + best.x1) / 2, (best.y0 + best.y1) / 2 + 0.33 * em_}, name.text, size,
                 theme, TextAlign::centre);
    }

    void take(const Box& box) { taken_.push_back(box); }

 private:
    bool allowed(const Box& box, bool across) const {
        if (box.x0 < frame_.left + 0.2 * em_ || box.x1 > frame_.right - 0.1 * em_ || box.y0 < frame_.top ||
            box.y1 > frame_.bottom - 0.2 * em_)
            return false;
        for (const Box& other : taken_)
            if (overlap(box, other)) return false;
        if (across) return true;
        for (const PlaneLine& line : lines_)
            if (meets(box, {frame_.x(line.from.x()), frame_.y(line.from.y())},
                      {frame_.x(line.to.x()), frame_.y(line.to.y())}))
                return false;
        return true;
    }

    /// The sum of the cells under the box.
    double covered(const Box& box) const {
        const double cells = static_cast<double>(density_.side), step = frame_.width() / cells,
                     rise = frame_.height() / cells;
        const auto at = [&](double cell) {
            return static_cast<std::size_t>(std::clamp(std::floor(cell), 0.0, cells - 1));
        };
        double sum = 0;
        for (std::size_t y = at((frame_.bottom - box.y1) / rise); y <= at((frame_.bottom - box.y0) / rise);
             ++y)
            for (std::size_t x = at((box.x0 - frame_.left) / step); x <= at((box.x1 - frame_.left) / step);
                 ++x)
                sum += density_.values[y * density_.side + x];
        return sum;
    }

    const PlaneDensity& density_;
    const PlotFrame& frame_;
    const std::vector<PlaneLine>& lines_;
    double em_;
    std::vector<Box> taken_;
};

/// A square frame with room for the colour bar and its words on the right.
PlotFrame square_frame(const PlaneDensity& density, const PlotOptions& options, double em, Ticks& xs,
                       Ticks& ys) {
    PlotFrame frame = frame_of(options, em);
    frame.x_low = frame.y_low = density.low;
    frame.x_high = frame.y_high = density.high;
    ys = linear_ticks(frame, em);
    finish_frame(frame, ys, options, em);
    frame.left = std::round(frame.left);
    const double room = std::min(options.width - 8 * em - frame.left, frame.height());
    frame.top = std::round(frame.top);
    const double side = std::max(20.0, std::floor(room));
    frame.right = frame.left + side;
    frame.bottom = frame.top + side;
    ys = linear_ticks(frame, em);
    xs = make_ticks(frame.x_low, frame.x_high, std::max(2, static_cast<int>(side / (4.5 * em))));
    return frame;
}

}  // namespace

Drawing plot_plane(const PlaneDensity& density, const PlanePlot& plane, const PlotOptions& options) {
    options.check();
    check_plane(density, plane);
    Drawing drawing = empty_drawing(options);
    // A square leaves less of the width than other plots have: the words go by the height too.
    const double em = std::max(10.0, std::min(options.width / 36.0, options.height / 30.0));
    Ticks xs, ys;
    const PlotFrame frame = square_frame(density, options, em, xs, ys);
    const double greatest = *std::max_element(density.values.begin(), density.values.end());
    const Shading shading{greatest > 0 ? std::log10(greatest) : 0, plane.powers};
    const Colormap map("sequential");
    const Theme& theme = options.theme;
    add_cells(drawing, density, frame, map, shading);
    Drawing::Lines lines{{}, std::max(1.0, 0.06 * em), theme.ink, Role::ink};
    for (const PlaneLine& line : plane.lines)
        lines.chains.push_back(
            {{frame.x(line.from.x()), frame.y(line.from.y())}, {frame.x(line.to.x()), frame.y(line.to.y())}});
    drawing.shapes.push_back(std::move(lines));
    Names names(density, frame, plane.lines, em);
    if (!plane.note.empty()) {
        const double size = fitting_size(plane.note, 0.85 * em, frame.width() - em);
        const double x = frame.left + 0.6 * em, y = frame.top + 1.2 * em;
        add_text(drawing, {x, y}, plane.note, size, theme);
        names.take({x, frame.top, x + text_width(plane.note, size), y + 0.3 * em});
    }
    for (const PlaneName& name : plane.names) names.add(drawing, name, theme);
    add_axes(drawing, frame, xs, ys, em, theme);
    add_words(drawing, frame, options, em);
    add_bar(drawing, frame, map, shading, plane.bar_label, em, theme);
    return drawing;
}

}  // namespace vdbgeo
