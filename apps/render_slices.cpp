#include "apps/render_slices.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "apps/stages.h"
#include "converters/map_file.h"
#include "vdbgeo/view/png.h"

namespace vdbgeo::app {

SliceWish SliceWish::parse(const std::string& text) {
    const auto fail = [&] {
        return UsageError(fmt::format(
            "--slice: '{}' is not x, y or z, or one with a voxel (z=40) or a place in \u00c5 (z=120A)",
            text));
    };
    const std::size_t axis = text.empty() ? std::string::npos : std::string("xyz").find(text[0]);
    if (axis == std::string::npos || (text.size() > 1 && text[1] != '=')) throw fail();
    SliceWish wish;
    wish.axis = static_cast<int>(axis);
    if (text.size() == 1) return wish;
    const char *at = text.data() + 2, *end = text.data() + text.size();
    double number = 0;
    const auto [rest, error] = std::from_chars(at, end, number);
    const std::string unit(rest, static_cast<std::size_t>(end - rest));
    if (error != std::errc() || !std::isfinite(number)) throw fail();
    if (unit == "A" || unit == "\u00c5") {
        wish.place_A = number;
    } else {
        if (!unit.empty() || number != std::floor(number) || std::abs(number) > 1e9) throw fail();
        wish.voxel = static_cast<int>(number);
    }
    return wish;
}

Section SliceWish::take(const DensityMap& map) const {
    return take_section(map, axis, place_A ? voxel_at(map, axis, *place_A) : voxel);
}

Image slices_picture(const SlicesInput& input, const RenderOptions& options, Session& session) {
    std::vector<SliceWish> wishes = input.wishes;
    if (wishes.empty()) wishes = {{2, {}, {}}, {1, {}, {}}, {0, {}, {}}};
    std::vector<SectionRow> rows;
    SectionFigureOptions figure;
    for (std::size_t i = 0; i < input.files.size(); ++i) {
        const std::string& file = input.files[i];
        const MapFile in = read_map(file, input.reading, session.stage("reading"));
        for (const std::string& w : in.warnings) session.warn(file + ": " + w);
        SectionRow row;
        row.name = input.names[i];
        naming(file, [&] {
            for (const SliceWish& wish : wishes) row.sections.push_back(wish.take(in.map));
            if (input.contour) row.isovalue = input.contour->resolve(in.map);
        });
        rows.push_back(std::move(row));
        if (in.level_set) figure.label = "signed distance (\u00c5)";
    }
    figure.width = options.width;
    figure.colormap = options.colormap;
    figure.range_min = options.range_min, figure.range_max = options.range_max;
    figure.background = options.background;
    figure.title = options.title;
    if (options.label) figure.label = *options.label;
    return draw_section_figure(rows, figure);
}

void SlicePairs::take_before(const DensityMap& map) {
    for (int axis = 0; axis < 3; ++axis) before_[static_cast<std::size_t>(axis)] = take_section(map, axis);
}

void SlicePairs::take_after(const DensityMap& map) {
    // The same voxels, should the map's box have changed.
    for (std::size_t axis = 0; axis < 3; ++axis)
        after_[axis] = take_section(map, static_cast<int>(axis), before_[axis].index);
}

std::vector<std::string> SlicePairs::write(const std::string& prefix) const {
    const Greys greys = greys_of_all(before_);
    std::vector<std::string> names;
    for (const auto& [word, sections] : {std::pair("before", &before_), std::pair("after", &after_)})
        for (const Section& s : *sections) {
            names.push_back(fmt::format("{}_{}_{}.png", prefix, word, "xyz"[s.axis]));
            write_png(section_pixels(s, greys), names.back());
        }
    return names;
}

}  // namespace vdbgeo::app
