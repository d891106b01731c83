#include "vdbgeo/view/layout.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/text.h"
#include "vdbgeo/view/ticks.h"

namespace vdbgeo {
namespace {

// Heights of the strips around the views, in ems.
constexpr double title_height = 2.2, caption_height = 3.2, footer_height = 4.4, margin = 1.0, gap = 1.6;

View front() { return {"front", Vec3d::UnitX(), Vec3d::UnitZ(), -Vec3d::UnitY()}; }
View side() { return {"side", Vec3d::UnitY(), Vec3d::UnitZ(), Vec3d::UnitX()}; }
View top() { return {"top", Vec3d::UnitX(), Vec3d::UnitY(), Vec3d::UnitZ()}; }

/// From a place in this direction; z is up, or y where that cannot be.
View seen_from(const std::string& name, const Vec3d& direction) {
    const Vec3d towards = direction.normalized();
    const Vec3d up = towards.head<2>().norm() > 1e-3 ? Vec3d::UnitZ() : Vec3d::UnitY();
    const Vec3d right = up.cross(towards).normalized();
    return {name, right, towards.cross(right), towards};
}

View iso() { return seen_from("iso", {0.55, -0.75, 0.55}); }

/// "x,y,z" as a direction, if it is one.
std::optional<Vec3d> parse_direction(const std::string& text) {
    Vec3d v;
    const char *at = text.data(), *end = at + text.size();
    for (int i = 0; i < 3; ++i) {
        const auto [rest, error] = std::from_chars(at, end, v[i]);
        if (error != std::errc() || (i < 2 ? rest == end || *rest != ',' : rest != end)) return {};
        at = rest + (i < 2);
    }
    if (!v.allFinite() || !(v.norm() > 1e-100 && v.norm() < 1e100)) return {};
    return v;
}

Vec3f ink(const RenderOptions& options) {
    return luminance(options.background) > 0.3 ? Vec3f::Constant(0.13f) : Vec3f::Constant(0.92f);
}

/// The size at which `text` is no wider than `room`, at most `size`.
double fitting(const std::string& text, double size, double room) {
    const double width = text_width(text, size);
    return width > room ? size * room / width : size;
}

bool has_footer(const RenderOptions& options) { return options.scale_bar || options.property; }

/// Value at fraction q of the sorted order, by selection.
float percentile(std::vector<float>& values, double q) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

void draw_arrow(Image& image, const Vec2d& from, const Vec2d& to, double text, const Vec3f& colour) {
    const Vec2d along = (to - from).normalized(), across(-along.y(), along.x());
    const double head = 0.32 * text;
    draw_segments(image,
                  {{from, to},
                   {to, to - head * along + 0.55 * head * across},
                   {to, to - head * along - 0.55 * head * across}},
                  std::max(1.0, 0.08 * text), colour);
}

/// The directions of x, y, z in a view, and its name.
void draw_caption(Image& image, const Panel& panel, const Layout& layout, const Vec3f& colour) {
    const double em = layout.text, arrow = 1.35 * em;
    const Vec2d corner(panel.x + 0.5 * em, layout.caption_top + 2.75 * em);
    const bool slanted = panel.view.towards.cwiseAbs().maxCoeff() < 0.999;
    const Vec2d origin = slanted ? Vec2d(corner.x() + 0.9 * em, corner.y() - 0.9 * em) : corner;
    for (int axis = 0; axis < 3; ++axis) {
        const Vec2d direction(panel.view.right[axis], -panel.view.up[axis]);
        if (direction.norm() < 0.1) continue;
        draw_arrow(image, origin, origin + arrow * direction, em, colour);
        const Vec2d tip = origin + (arrow + 0.5 * em) * direction;
        draw_text(image, tip + Vec2d(0, 0.2 * em), std::string(1, "xyz"[axis]), 0.8 * em, colour,
                  TextAlign::centre);
    }
    draw_text(image, Vec2d(corner.x() + 3.2 * em, corner.y()), panel.view.name, em, colour);
}

std::string length_label(double A) {
    if (A >= 1e4) return fmt::format("{:g} \u00b5m", A / 1e4);
    if (A >= 1e3) return fmt::format("{:g} nm", A / 10);
    return fmt::format("{:g} \u00c5", A);
}

void draw_scale_bar(Image& image, const Layout& layout, double room, const Vec3f& colour) {
    const double em = layout.text;
    const double length = round_down(std::min(room, 0.25 * layout.width) / layout.pixels_per_A);
    const double x = margin * em, y = layout.footer_top + 2.35 * em, thick = std::max(2.0, 0.22 * em);
    const double wide = length * layout.pixels_per_A;
    fill_rectangle(image, x, y - thick / 2, x + wide, y + thick / 2, colour);
    draw_text(image, Vec2d(x + wide / 2, y + 1.3 * em), length_label(length), em, colour, TextAlign::centre);
}

/// The bar itself, for a continuous map.
void draw_gradient(Image& image, const ColourScale& scale, double x0, double x1, double y0, double y1) {
    for (int x = static_cast<int>(std::ceil(x0)); x < static_cast<int>(x1); ++x)
        fill_rectangle(image, x, y0, x + 1, y1, scale.map.colour((x + 0.5 - x0) / (x1 - x0)));
}

void draw_colour_bar(Image& image, const Layout& layout, const ColourScale& scale, double x0, double x1,
                     const Vec3f& colour) {
    const double em = layout.text, y0 = layout.footer_top + 1.95 * em, y1 = y0 + 0.75 * em;
    const double line = std::max(1.0, 0.06 * em);
    x0 = std::round(x0), x1 = std::round(x1);
    draw_text(image, Vec2d((x0 + x1) / 2, y0 - 0.45 * em), scale.label, fitting(scale.label, em, x1 - x0),
              colour, TextAlign::centre);
    const double text_base = y1 + 1.15 * em;
    if (scale.map.categories() > 0) {
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
    draw_segments(image,
                  {{{x0, y0}, {x1, y0}}, {{x1, y0}, {x1, y1}}, {{x1, y1}, {x0, y1}}, {{x0, y1}, {x0, y0}}},
                  line, colour);
}

}  // namespace

std::vector<View> find_views(const std::string& name) {
    if (name == "three") return {front(), side(), top()};
    for (const View& view : {front(), side(), top(), iso()})
        if (view.name == name) return {view};
    if (const auto direction = parse_direction(name)) return {seen_from("from " + name, *direction)};
    throw InvalidInput(
        fmt::format("view '{}' is not one of three, front, side, top, iso, nor a direction x,y,z", name));
}

Layout arrange(const std::vector<View>& views, const std::vector<ViewBox>& boxes,
               const RenderOptions& options) {
    Layout layout{};
    layout.width = options.width;
    const double em = layout.text = std::max(11.0, options.width / 58.0);
    double across = 0, high = 0;
    for (const ViewBox& box : boxes) {
        across += box.high.x() - box.low.x();
        high = std::max(high, box.high.y() - box.low.y());
    }
    const double above = (options.title.empty() ? margin : margin + title_height) * em;
    const double caption = options.axis_labels ? caption_height * em : 0;
    const double footer = has_footer(options) ? footer_height * em : 0;
    const double strips = above + caption + footer + margin * em;
    const double room_x = options.width - (2 * margin + gap * static_cast<double>(views.size() - 1)) * em;
    double room_y = (options.height ? *options.height : options.width) - strips;
    if (room_x < 16 || room_y < 16)
        throw InvalidInput(fmt::format("a picture {} pixels wide{} leaves no room for the surface",
                                       options.width,
                                       options.height ? fmt::format(" and {} high", *options.height) : ""));
    // One pixel is left on each side for the antialiased edge.
    const double scale_x = across > 0 ? (room_x - 2.0 * static_cast<double>(views.size())) / across : 1e300;
    const double scale_y = high > 0 ? (room_y - 2) / high : 1e300;
    layout.pixels_per_A = std::min(scale_x, scale_y);
    if (!options.height) room_y = std::max(16.0, std::ceil(high * layout.pixels_per_A + 2));
    layout.height = options.height ? *options.height : static_cast<int>(std::ceil(room_y + strips));
    layout.title_base = (margin + 0.9) * em;
    layout.caption_top = above + room_y;
    layout.footer_top = layout.caption_top + caption;
    // What the surface does not need is spread evenly between the views.
    const double spare = (room_x - across * layout.pixels_per_A) / static_cast<double>(views.size());
    double x = margin * em;
    for (std::size_t i = 0; i < views.size(); ++i) {
        const double wide = (boxes[i].high.x() - boxes[i].low.x()) * layout.pixels_per_A + spare;
        const Vec3d middle = (boxes[i].low + boxes[i].high) / 2;
        layout.panels.push_back({views[i], static_cast<int>(x), static_cast<int>(above),
                                 std::max(1, static_cast<int>(wide)), static_cast<int>(room_y),
                                 middle.head<2>()});
        x += wide + gap * em;
    }
    return layout;
}

Vec3f ColourScale::colour(double value) const {
    if (!std::isfinite(value)) return Vec3f::Constant(0.6f);
    if (map.categories() > 0) return map.category(std::llround(std::clamp(value, -1e15, 1e15)));
    return map.colour((value - low) / (high - low));
}

ColourScale choose_scale(const std::vector<float>& values, const RenderOptions& options) {
    std::vector<float> finite;
    std::copy_if(values.begin(), values.end(), std::back_inserter(finite),
                 [](float v) { return std::isfinite(v); });
    if (finite.empty()) finite = {0};
    double low = percentile(finite, 0.02), high = percentile(finite, 0.98);
    const std::string label = options.label.value_or(*options.property);
    if (options.colormap == "categorical") {
        const auto [first, last] = std::minmax_element(finite.begin(), finite.end());
        low = std::round(*first), high = std::round(*last);
        return {Colormap("categorical"), low, std::min(high, low + 15), label};
    }
    const bool both_signs = options.range_min.value_or(low) < 0 && options.range_max.value_or(high) > 0;
    const Colormap map(options.colormap.value_or(both_signs ? "diverging" : "sequential"));
    if (map.diverging()) {
        // Zero belongs in the middle: what is not given mirrors what is.
        const double reach = options.range_max   ? std::abs(*options.range_max)
                             : options.range_min ? std::abs(*options.range_min)
                                                 : std::max(std::abs(low), std::abs(high));
        low = -reach, high = reach;
    }
    low = options.range_min.value_or(low), high = options.range_max.value_or(high);
    if (!(high > low)) {  // a constant property, or one given end beyond the data
        const double pad =
            std::max(std::abs(low), std::abs(high)) > 0 ? 0.5 * std::max(std::abs(low), std::abs(high)) : 1;
        if (options.range_min)
            high = low + pad;
        else if (options.range_max)
            low = high - pad;
        else
            low -= pad, high += pad;
    }
    return {map, low, high, label};
}

void draw_decorations(Image& image, const Layout& layout, const RenderOptions& options,
                      const std::optional<ColourScale>& scale) {
    const Vec3f colour = ink(options);
    const double em = layout.text, left = margin * em, right = layout.width - margin * em;
    if (!options.title.empty()) {
        const double size = fitting(options.title, 1.25 * em, right - left);
        draw_text(image, Vec2d(left, layout.title_base), options.title, size, colour);
    }
    if (options.axis_labels)
        for (const Panel& panel : layout.panels) draw_caption(image, panel, layout, colour);
    const double middle = left + 0.42 * (right - left);
    if (options.scale_bar) draw_scale_bar(image, layout, (scale ? middle - 2 * em : right) - left, colour);
    if (scale) draw_colour_bar(image, layout, *scale, middle, right - 1.5 * em, colour);
}

}  // namespace vdbgeo
