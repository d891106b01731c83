#include "vdbgeo/view/svg.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string_view>

#include "vdbgeo/core/atomic_file.h"

namespace vdbgeo {
namespace {

using Role = Drawing::Role;

/// Hundredths of a pixel, without zeros at the end.
std::string number(double value) {
    const double rounded = std::round(100 * value) / 100;
    return fmt::format("{}", rounded == 0 ? 0.0 : rounded);
}

std::string hex(const Vec3f& colour) {
    return fmt::format("#{:02x}{:02x}{:02x}", to_byte(colour[0]), to_byte(colour[1]), to_byte(colour[2]));
}

/// Length of the UTF-8 sequence at the beginning of `text` if XML can hold its character, else 0.
std::size_t valid_length(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char lead = byte(0);
    if (lead < 0x80) return lead >= 0x20 && lead != 0x7F ? 1 : 0;
    const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return 0;
    char32_t code = lead & (0x7Fu >> length);
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xC0) != 0x80) return 0;
        code = code << 6 | (byte(i) & 0x3F);
    }
    const bool too_long = code < (length == 2 ? 0x80u : length == 3 ? 0x800u : 0x10000u);
    const bool none = (code >= 0xD800 && code < 0xE000) || code > 0x10FFFF || (code & 0xFFFE) == 0xFFFE ||
                      (code >= 0x80 && code < 0xA0);
    return too_long || none ? 0 : length;
}

std::string escaped(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const std::size_t length = valid_length(text);
        const std::string_view one = text.substr(0, std::max<std::size_t>(1, length));
        if (length == 0)
            out += "\ufffd";
        else if (one == "&")
            out += "&amp;";
        else if (one == "<")
            out += "&lt;";
        else if (one == ">")
            out += "&gt;";
        else if (one == "\"")
            out += "&quot;";
        else
            out += one;
        text.remove_prefix(one.size());
    }
    return out;
}

/// The class of a shape, with a space before it; nothing for a colour of its own.
std::string class_of(Role role, const char* ink) {
    switch (role) {
        case Role::ink:
            return fmt::format(" class=\"{}\"", ink);
        case Role::grid:
            return " class=\"grid\"";
        case Role::paper:
            return " class=\"paper\"";
        case Role::own:
            break;
    }
    return "";
}

std::string element(const Drawing::Lines& lines) {
    std::string path;
    for (const auto& chain : lines.chains)
        for (std::size_t i = 0; i < chain.size(); ++i)
            path += fmt::format("{}{} {}", i == 0 ? "M" : "L", number(chain[i].x()), number(chain[i].y()));
    if (path.empty()) return "";
    return fmt::format(
        "<path{} d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\" "
        "stroke-linejoin=\"round\"/>\n",
        class_of(lines.role, "ink-line"), path, hex(lines.colour), number(lines.thickness));
}

std::string element(const Drawing::Boxes& boxes) {
    std::string path;
    bool whole = true;  // edges between pixels are kept sharp where they lie there on purpose
    for (const auto& b : boxes.boxes) {
        for (const double edge : {b.x0, b.y0, b.x1, b.y1}) whole = whole && edge == std::floor(edge);
        path += fmt::format("M{} {}H{}V{}H{}z", number(b.x0), number(b.y0), number(b.x1), number(b.y1),
                            number(b.x0));
    }
    if (path.empty()) return "";
    return fmt::format("<path{} d=\"{}\" fill=\"{}\"{}{}/>\n", class_of(boxes.role, "ink-text"), path,
                       hex(boxes.colour),
                       boxes.opacity < 1 ? fmt::format(" fill-opacity=\"{}\"", number(boxes.opacity)) : "",
                       whole ? " shape-rendering=\"crispEdges\"" : "");
}

std::string element(const Drawing::Text& text) {
    if (text.text.empty()) return "";
    const char* anchor = text.align == TextAlign::left     ? "start"
                         : text.align == TextAlign::centre ? "middle"
                                                           : "end";
    const std::string x = number(text.position.x()), y = number(text.position.y());
    return fmt::format(
        "<text{} x=\"{}\" y=\"{}\" font-size=\"{}\" text-anchor=\"{}\"{} fill=\"{}\">{}</text>\n",
        class_of(text.role, "ink-text"), x, y, number(text.size), anchor,
        text.upwards ? fmt::format(" transform=\"rotate(-90 {} {})\"", x, y) : "", hex(text.colour),
        escaped(text.text));
}

}  // namespace

std::string svg_text(const Drawing& drawing) {
    const std::string title = escaped(drawing.title.empty() ? "plot" : drawing.title);
    std::string out = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
        "role=\"img\" aria-label=\"{2}\" font-family=\"sans-serif\">\n<title>{2}</title>\n"
        "<rect class=\"paper\" width=\"{0}\" height=\"{1}\" fill=\"{3}\"/>\n",
        drawing.width, drawing.height, title, hex(drawing.paper));
    for (const Drawing::Shape& shape : drawing.shapes)
        out += std::visit([](const auto& s) { return element(s); }, shape);
    return out + "</svg>\n";
}

void write_svg(const Drawing& drawing, const std::filesystem::path& path) {
    write_file(path, svg_text(drawing));
}

}  // namespace vdbgeo
