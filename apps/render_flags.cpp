#include "apps/render_flags.h"

#include <fmt/format.h>

#include <charconv>
#include <optional>

#include "vdbgeo/view/theme.h"

namespace vdbgeo::app {
namespace {

/// "x,y,z".
std::optional<Vec3d> parse_place(const std::string& text) {
    Vec3d place;
    const char *at = text.data(), *end = text.data() + text.size();
    for (int i = 0; i < 3; ++i) {
        const auto [rest, error] = std::from_chars(at, end, place[i]);
        if (error != std::errc() || (i < 2 ? rest == end || *rest != ',' : rest != end)) return {};
        at = rest + (i < 2);
    }
    return place;
}

/// "white", "black", "dark" or "#rrggbb".
std::optional<Vec3f> parse_colour(const std::string& text) {
    if (text == "white") return Theme::light().paper;
    if (text == "black") return Vec3f(0, 0, 0);
    if (text == "dark") return Theme::dark().paper;
    if (text.size() != 7 || text[0] != '#') return {};
    Vec3f colour;
    for (int c = 0; c < 3; ++c) {
        int value = 0;
        const char* at = text.data() + 1 + 2 * c;
        const auto [rest, error] = std::from_chars(at, at + 2, value, 16);
        if (error != std::errc() || rest != at + 2 || value < 0) return {};
        colour[c] = static_cast<float>(value) / 255;
    }
    return colour;
}

}  // namespace

void add_scene_flags(CLI::App& app, RenderOptions& options) {
    app.add_option("--zoom", options.zoom, "Magnify about the middle of the views, 0.1 to 100")
        ->capture_default_str();
    app.add_option_function<std::string>(
        "--focus",
        [&options](const std::string& text) {
            options.focus = parse_place(text);
            if (!options.focus)
                throw CLI::ValidationError("--focus", fmt::format("'{}' is not x,y,z in Å", text));
        },
        "Place in the middle of the views, x,y,z in Å [the middle of what is drawn]");
    app.add_option("--columns", options.columns, "Meshes of one view in a row, 1 to 100 [to 3, or a square]");
    app.add_flag_callback(
        "--no-scale-bar", [&options] { options.scale_bar = false; }, "Without the bar of round length");
    app.add_flag_callback(
        "--no-silhouette", [&options] { options.outline = false; },
        "Without dark lines where the surface hides what is behind it");
    app.add_flag("--silhouettes-only", options.lines_only,
                 "A drawing of nothing but these lines, and of the edges with --edges");
    app.add_option_function<std::string>(
        "--background",
        [&options](const std::string& text) {
            const auto colour = parse_colour(text);
            if (!colour)
                throw CLI::ValidationError("--background",
                                           fmt::format("'{}' is not white, black, dark or #rrggbb", text));
            options.background = *colour;
        },
        "white, black, dark or #rrggbb; words and bars take an ink that can be read on it [white]");
}

}  // namespace vdbgeo::app
