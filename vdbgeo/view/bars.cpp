#include "vdbgeo/view/bars.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/view/text.h"
#include "vdbgeo/view/theme.h"
#include "vdbgeo/view/ticks.h"

namespace vdbgeo {
namespace {

void draw_arrow(Image& image, const Vec2d& from, const Vec2d& to, double text, const Vec3f& colour) {
    const Vec2d along = (to - from).normalized(), across(-along.y(), along.x());
    const double head = 0.32 * text;
    draw_segments(image,
                  {{from, to},
                   {to, to - head * along + 0.55 * head * across},
                   {to, to - head * along - 0.55 * head * across}},
                  std::max(1.0, 0.08 * text), colour);
}

std::string length_label(double A) {
    if (A >= 1e4) return fmt::format("{:g} \u00b5m", A / 1e4);
    if (A >= 1e3) return fmt::format("{:g} nm", A / 10);
    return fmt::format("{:g} \u00c5", A);
}

void draw_frame(Image& image, double x0, double y0, double x1, double y1, double line, const Vec3f& colour) {
    draw_segments(image,
                  {{{x0, y0}, {x1, y0}}, {{x1, y0}, {x1, y1}}, {{x1, y1}, {x0, y1}}, {{x0, y1}, {x0, y0}}},
                  line, colour);
}

/// The bar itself, for a continuous map.
void draw_gradient(Image& image, const ColourScale& scale, double x0, double x1, double y0, double y1) {
    for (int x = static_cast<int>(std::ceil(x0)); x < static_cast<int>(x1); ++x) {
        const double part = (x + 0.5 - x0) / (x1 - x0);
        fill_rectangle(image, x, y0, x + 1, y1, scale.colour(scale.low + part * (scale.high - scale.low)));
    }
}

/// A swatch and a name for each class, four beside each other.
void draw_legend(Image& image, const BarStrip& strip, const ColourScale& scale, const Vec3f& colour) {
    constexpr std::size_t across = 4;
    const double em = strip.em, step = (strip.right - strip.left) / across, side = 0.8 * em;
    std::size_t i = 0;
    for (const auto& [number, name] : scale.names) {
        const double x = strip.left + step * static_cast<double>(i % across);
        const double base = strip.top + (2.45 + 1.35 * static_cast<double>(i / across)) * em;
        ++i;
        fill_rectangle(image, x, base - side, x + side, base, scale.colour(number));
        draw_frame(image, x, base - side, x + side, base, std::max(1.0, 0.06 * em), colour);
        const double room = step - side - 0.8 * em;
        draw_text(image, Vec2d(x + side + 0.4 * em, base - 0.08 * em), name, fitting(name, 0.9 * em, room),
                  colour);
    }
}

}  // namespace

Vec3f ink_on(const Vec3f& background) {
    return luminance(background) > 0.3 ? Theme::light().ink : Theme::dark().ink;
}

double fitting(const std::string& text, double size, double room) {
    const double width = text_width(text, size);
    return width > room ? size * room / width : size;
}

Vec3f ColourScale::colour(double value) const {
    if (!std::isfinite(value)) return Vec3f::Constant(0.6f);
    if (map && map->categories() > 0) return map->category(std::llround(std::clamp(value, -1e15, 1e15)));
    const double part = (value - low) / (high - low);
    return map ? map->colour(part) : Vec3f::Constant(static_cast<float>(std::clamp(part, 0.0, 1.0)));
}

void draw_scale_bar(Image& image, const BarStrip& strip, double longest, double pixels_per_A,
                    const Vec3f& colour) {
    const double em = strip.em, length = round_down(longest / pixels_per_A);
    const double x = strip.left, y = strip.top + 2.35 * em, thick = std::max(2.0, 0.22 * em);
    const double wide = length * pixels_per_A;
    fill_rectangle(image, x, y - thick / 2, x + wide, y + thick / 2, colour);
    draw_text(image, Vec2d(x + wide / 2, y + 1.3 * em), length_label(length), em, colour, TextAlign::centre);
}

void draw_colour_bar(Image& image, const BarStrip& strip, const ColourScale& scale, const Vec3f& colour) {
    const double em = strip.em, y0 = strip.top + 1.95 * em, y1 = y0 + 0.75 * em;
    const double line = std::max(1.0, 0.06 * em);
    const double x0 = std::round(strip.left), x1 = std::round(strip.right);
    const bool legend = !scale.names.empty();
    const Vec2d title((x0 + x1) / 2, legend ? strip.top + em : y0 - 0.45 * em);
    draw_text(image, title, scale.label, fitting(scale.label, em, x1 - x0), colour, TextAlign::centre);
    if (legend) return draw_legend(image, strip, scale, colour);
    const double text_base = y1 + 1.15 * em;
    if (scale.map && scale.map->categories() > 0) {
        const double classes = scale.high - scale.low + 1, step = (x1 - x0) / classes;
        for (int i = 0; i < classes; ++i) {
            fill_rectangle(image, x0 + i * step, y0, x0 + (i + 1) * step, y1, scale.colour(scale.low + i));
            draw_text(image, Vec2d(x0 + (i + 0.5) * step, text_base), fmt::format("{:g}", scale.low + i),
                      0.9 * em, colour, TextAlign::centre);
        }
    } else {
        draw_gradient(image, scale, x0, x1, y0, y1);
        const Ticks ticks =
            make_ticks(scale.low, scale.high, std::clamp(static_cast<int>((x1 - x0) / (4 * em)), 2, 7));
        for (std::size_t i = 0; i < ticks.values.size(); ++i) {
            const double x = x0 + (ticks.values[i] - scale.low) / (scale.high - scale.low) * (x1 - x0);
            draw_line(image, Vec2d(x, y1), Vec2d(x, y1 + 0.2 * em), line, colour);
            draw_text(image, Vec2d(x, text_base), ticks.labels[i], 0.9 * em, colour, TextAlign::centre);
        }
    }
    draw_frame(image, x0, y0, x1, y1, line, colour);
}

void draw_axes(Image& image, const Vec2d& corner, const Vec3d& right, const Vec3d& up,
               const std::string& name, double em, const Vec3f& colour) {
    const double arrow = 1.35 * em;
    const bool slanted = right.cross(up).cwiseAbs().maxCoeff() < 0.999;
    const Vec2d origin = slanted ? Vec2d(corner.x() + 0.9 * em, corner.y() - 0.9 * em) : corner;
    for (int axis = 0; axis < 3; ++axis) {
        const Vec2d direction(right[axis], -up[axis]);
        if (direction.norm() < 0.1) continue;
        draw_arrow(image, origin, origin + arrow * direction, em, colour);
        const Vec2d tip = origin + (arrow + 0.5 * em) * direction;
        draw_text(image, tip + Vec2d(0, 0.2 * em), std::string(1, "xyz"[axis]), 0.8 * em, colour,
                  TextAlign::centre);
    }
    draw_text(image, Vec2d(corner.x() + 3.2 * em, corner.y()), name, em, colour);
}

}  // namespace vdbgeo
