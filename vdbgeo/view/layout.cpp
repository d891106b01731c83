#include "vdbgeo/view/layout.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/view/property_text.h"
#include "vdbgeo/view/text.h"

namespace vdbgeo {
namespace {

// Heights of the strips around the views, in ems.
constexpr double title_height = 2.2, caption_height = 3.2, label_height = 2.2, margin = 1.0, gap = 1.6;

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

bool has_footer(const RenderOptions& options) { return options.scale_bar || options.property; }

/// Value at fraction q of the sorted order, by selection.
float percentile(std::vector<float>& values, double q) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
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

View turned(const View& view, double radians) {
    const Vec3d axis = std::abs(view.towards.z()) < 0.999 ? Vec3d::UnitZ() : view.up;
    const Eigen::AngleAxisd turn(-radians, axis);
    return {view.name, turn * view.right, turn * view.up, turn * view.towards};
}

Layout arrange(const std::vector<Cell>& cells, std::size_t columns, const RenderOptions& options) {
    const std::size_t rows = (cells.size() + columns - 1) / columns;
    std::vector<double> wide(columns, 0), high(rows, 0);  // Å
    bool labelled = false;
    for (std::size_t i = 0; i < cells.size(); ++i) {
        const Vec3d size = cells[i].box.high - cells[i].box.low;
        wide[i % columns] = std::max(wide[i % columns], size.x());
        high[i / columns] = std::max(high[i / columns], size.y());
        labelled = labelled || !cells[i].label.empty();
    }
    const double across = std::accumulate(wide.begin(), wide.end(), 0.0);
    const double down = std::accumulate(high.begin(), high.end(), 0.0);
    const double columns_n = static_cast<double>(columns), rows_n = static_cast<double>(rows);

    Layout layout{};
    layout.width = options.width;
    const double em = layout.text = std::max(11.0, options.width / 58.0);
    const double above = (options.title.empty() ? margin : margin + title_height) * em;
    const double over_row = labelled ? label_height * em : rows > 1 ? gap * em : 0;
    const double caption = options.axis_labels ? caption_height * em : 0;
    const double footer = has_footer(options) ? bar_height * em : 0;
    const double strips = above + rows_n * over_row + caption + footer + margin * em;
    const double room_x = options.width - (2 * margin + gap * (columns_n - 1)) * em;
    const double tallest = rows > 1 ? 1.5 * options.width : options.width;
    double room_y = (options.height ? *options.height : tallest) - strips;
    if (room_x < 16 * columns_n || room_y < 16 * rows_n)
        throw InvalidInput(fmt::format("a picture {} pixels wide{} leaves no room for the surface",
                                       options.width,
                                       options.height ? fmt::format(" and {} high", *options.height) : ""));
    // One pixel is left on each side for the antialiased edge.
    const double scale_x = across > 0 ? (room_x - 2 * columns_n) / across : 1e300;
    const double scale_y = down > 0 ? (room_y - 2 * rows_n) / down : 1e300;
    const double fit = std::min(scale_x, scale_y);
    if (!options.height) room_y = std::max(16.0 * rows_n, std::ceil(down * fit + 2 * rows_n));
    layout.pixels_per_A = fit * options.zoom;
    layout.height = options.height ? *options.height : static_cast<int>(std::ceil(room_y + strips));
    layout.title_base = (margin + 0.9) * em;
    layout.caption_top = above + rows_n * over_row + room_y;
    layout.footer_top = layout.caption_top + caption;
    // What the surface does not need is spread evenly between the views.
    const double spare_x = (room_x - across * fit) / columns_n, spare_y = (room_y - down * fit) / rows_n;
    const auto whole = [](double v) { return std::max(1, static_cast<int>(v + 1e-6)); };
    double y = above;
    for (std::size_t row = 0; row < rows; ++row) {
        y += over_row;
        double x = margin * em;
        for (std::size_t c = 0; c < columns && row * columns + c < cells.size(); ++c) {
            const Cell& cell = cells[row * columns + c];
            const double width = wide[c] * fit + spare_x;
            layout.panels.push_back({cell.view, static_cast<int>(x), static_cast<int>(y), whole(width),
                                     whole(high[row] * fit + spare_y), cell.middle, cell.label, false});
            x += width + gap * em;
        }
        y += high[row] * fit + spare_y;
    }
    // The axes below the last row stand for all, and once for the same view.
    for (std::size_t i = (rows - 1) * columns; i < cells.size(); ++i)
        layout.panels[i].captioned =
            i == (rows - 1) * columns || cells[i].view.name != cells[i - 1].view.name;
    return layout;
}

ColourScale choose_scale(const std::vector<float>& values, const RenderOptions& options) {
    std::vector<float> finite;
    std::copy_if(values.begin(), values.end(), std::back_inserter(finite),
                 [](float v) { return std::isfinite(v); });
    if (finite.empty()) finite = {0};
    double low = percentile(finite, 0.02), high = percentile(finite, 0.98);
    const PropertyText known = property_text(*options.property);
    const std::string label = options.label.value_or(known.label);
    if (options.colormap ? options.colormap == "categorical" : known.classes) {
        const auto [first, last] = std::minmax_element(finite.begin(), finite.end());
        low = std::round(*first), high = std::round(*last);
        return {Colormap("categorical"), low, std::min(high, low + 15), label, options.class_names};
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
    return {map, low, high, label, {}};
}

void draw_decorations(Image& image, const Layout& layout, const RenderOptions& options,
                      const std::optional<ColourScale>& scale) {
    const Vec3f colour = ink_on(options.background);
    const double em = layout.text, left = margin * em, right = layout.width - margin * em;
    if (!options.title.empty()) {
        const double size = fitting(options.title, 1.25 * em, right - left);
        draw_text(image, Vec2d(left, layout.title_base), options.title, size, colour);
    }
    for (const Panel& panel : layout.panels) {
        const Vec2d place(panel.x + 0.5 * panel.width, panel.y - 0.5 * em);
        draw_text(image, place, panel.label, fitting(panel.label, 1.1 * em, panel.width), colour,
                  TextAlign::centre);
        if (options.axis_labels && panel.captioned)
            draw_axes(image, Vec2d(panel.x + 0.5 * em, layout.caption_top + 2.75 * em), panel.view.right,
                      panel.view.up, panel.view.name, em, colour);
    }
    const double middle = left + 0.42 * (right - left);
    if (options.scale_bar) {
        const double room = (scale ? middle - 2 * em : right) - left;
        draw_scale_bar(image, {left, right, layout.footer_top, em}, std::min(room, 0.25 * layout.width),
                       layout.pixels_per_A, colour);
    }
    if (scale) draw_colour_bar(image, {middle, right - 1.5 * em, layout.footer_top, em}, *scale, colour);
}

}  // namespace vdbgeo
