#include "vdbgeo/view/plot_legend.h"

#include <algorithm>

namespace vdbgeo {
namespace {

constexpr double sample = 2.4, row_height = 1.5;  // em: from a sample's left end to its words

struct Box {
    double x0, y0, x1, y1;
};

/// Whether the line from a to b has a point in the box.
bool touches(const Box& box, const Vec2d& a, const Vec2d& b) {
    double from = 0, to = 1;
    const double low[2] = {box.x0, box.y0}, high[2] = {box.x1, box.y1};
    for (int axis = 0; axis < 2; ++axis) {
        const double step = b[axis] - a[axis];
        if (step == 0) {
            if (a[axis] < low[axis] || a[axis] > high[axis]) return false;
            continue;
        }
        const double t0 = (low[axis] - a[axis]) / step, t1 = (high[axis] - a[axis]) / step;
        from = std::max(from, std::min(t0, t1));
        to = std::min(to, std::max(t0, t1));
    }
    return from <= to;
}

bool clear(const Box& box, const std::vector<std::vector<Vec2d>>& chains) {
    for (const auto& chain : chains)
        for (std::size_t i = 1; i < chain.size(); ++i)
            if (touches(box, chain[i - 1], chain[i])) return false;
    return true;
}

}  // namespace

void Legend::add_entry(Drawing& drawing, const Curve& curve, double x, double y, double size,
                       const Theme& theme) const {
    add_line(drawing, {x, y - 0.35 * em_}, {x + 1.8 * em_, y - 0.35 * em_}, std::max(2.0, 0.2 * em_),
             curve.colour, Drawing::Role::own);
    add_text(drawing, {x + sample * em_, y}, curve.name, size, theme);
}

bool Legend::add_inside(Drawing& drawing, const PlotFrame& frame,
                        const std::vector<std::vector<Vec2d>>& chains, const Theme& theme) const {
    double widest = 0, rows = 0;
    for (const Curve& curve : curves_) {
        if (curve.name.empty()) continue;
        widest = std::max(widest, text_width(curve.name, em_));
        rows += 1;
    }
    if (rows == 0) return true;
    // Around the entries half an em stays free.
    const double width = widest + (sample + 1) * em_, height = (row_height * rows + 0.4) * em_;
    if (width > 0.7 * frame.width() || height > 0.7 * frame.height()) return false;
    for (double y = frame.top; y + height <= frame.bottom; y += 0.5 * em_)
        for (double x = frame.right - width - 0.5 * em_; x >= frame.left + 0.5 * em_; x -= 0.5 * em_) {
            if (!clear({x, y, x + width, y + height}, chains)) continue;
            double line = y + 1.1 * em_;
            for (const Curve& curve : curves_) {
                if (curve.name.empty()) continue;
                add_entry(drawing, curve, x + 0.5 * em_, line, em_, theme);
                line += row_height * em_;
            }
            return true;
        }
    return false;
}

std::vector<Legend::Entry> Legend::in_rows(double width) const {
    std::vector<Entry> entries;
    double x = 0;
    int row = 0;
    for (const Curve& curve : curves_) {
        if (curve.name.empty()) continue;
        const double size = fitting_size(curve.name, em_, width - sample * em_);
        const double wide = sample * em_ + text_width(curve.name, size);
        if (x > 0 && x + wide > width) x = 0, ++row;
        entries.push_back({&curve, x, size, row});
        x += wide + 1.5 * em_;
    }
    return entries;
}

double Legend::height_above(double width) const {
    const auto entries = in_rows(width);
    return entries.empty() ? 0 : (row_height * (entries.back().row + 1) + 0.3) * em_;
}

void Legend::add_above(Drawing& drawing, double left, double top, double width, const Theme& theme) const {
    for (const Entry& e : in_rows(width))
        add_entry(drawing, *e.curve, left + e.x, top + (1.1 + row_height * e.row) * em_, e.size, theme);
}

}  // namespace vdbgeo
