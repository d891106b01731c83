#include "vdbgeo/view/text.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace vdbgeo {
namespace {

/// One character as pen strokes. Units: em 20, capitals 14, small letters 10, descenders −4 high. `path`
/// lists strokes separated by ';'. A stroke is a chain of points "x y" and elliptic arcs "(cx cy rx ry from
/// to)", the angles in degrees, counter-clockwise where `to` is larger.
struct Glyph {
    char32_t code;
    double width;
    const char* path;
};

constexpr Glyph glyphs[] = {
    {U' ', 2.6, ""},
    {U'A', 11, "0 0 5.5 14 11 0;1.9 4.8 9.1 4.8"},
    {U'B', 8.5,
     "4.5 7.3 0 7.3 0 14 4.5 14 (4.5 10.65 3.35 3.35 90 -90);0 7.3 0 0 4.8 0 (4.8 3.65 3.7 3.65 -90 90)"},
    {U'C', 11.2, "(6.6 7 6.6 7 46 314)"},
    {U'D', 10.5, "0 0 0 14 3.8 14 (3.8 7 6.7 7 90 -90) 0 0"},
    {U'E', 8, "8 14 0 14 0 0 8 0;0 7.2 7 7.2"},
    {U'F', 7.8, "7.8 14 0 14 0 0;0 7.2 6.8 7.2"},
    {U'G', 12.6, "(6.6 7 6.6 7 46 360) 7.6 7"},
    {U'H', 10, "0 0 0 14;10 0 10 14;0 7.2 10 7.2"},
    {U'I', 0, "0 0 0 14"},
    {U'J', 6, "6 14 6 3.8 (3 3.8 3 3.8 0 -170)"},
    {U'K', 9.4, "0 0 0 14;9 14 0 5.4;3.4 8.7 9.4 0"},
    {U'L', 7.4, "0 14 0 0 7.4 0"},
    {U'M', 12, "0 0 0 14 6 4 12 14 12 0"},
    {U'N', 10, "0 0 0 14 10 0 10 14"},
    {U'O', 13.4, "(6.7 7 6.7 7 0 360)"},
    {U'P', 8.6, "0 0 0 14 4.8 14 (4.8 10.2 3.8 3.8 90 -90) 0 6.4"},
    {U'Q', 13.4, "(6.7 7 6.7 7 0 360);8.2 4 12.8 -1"},
    {U'R', 9, "0 0 0 14 4.8 14 (4.8 10.2 3.8 3.8 90 -90) 0 6.4;4.6 6.4 9 0"},
    {U'S', 8.4, "(4.2 10.55 3.7 3.45 35 270) (4.2 3.55 4.2 3.55 90 -145)"},
    {U'T', 10, "0 14 10 14;5 14 5 0"},
    {U'U', 10, "0 14 0 5 (5 5 5 5 180 360) 10 14"},
    {U'V', 10.6, "0 14 5.3 0 10.6 14"},
    {U'W', 15.6, "0 14 3.9 0 7.8 13 11.7 0 15.6 14"},
    {U'X', 9.6, "0 0 9.4 14;0.2 14 9.6 0"},
    {U'Y', 10, "0 14 5 6.8 10 14;5 6.8 5 0"},
    {U'Z', 9.2, "0.2 14 9 14 0 0 9.2 0"},
    {U'a', 8.6, "(4.3 5 4.3 5 0 360);8.6 10 8.6 0"},
    {U'b', 8.6, "0 14 0 0;(4.3 5 4.3 5 0 360)"},
    {U'c', 7.8, "(4.6 5 4.6 5 47 313)"},
    {U'd', 8.6, "8.6 14 8.6 0;(4.3 5 4.3 5 0 360)"},
    {U'e', 8.8, "0 5 8.8 5 (4.4 5 4.4 5 0 315)"},
    {U'f', 4.6, "(4.8 11.2 2.8 2.8 85 180) 2 0;0 9.8 4.6 9.8"},
    {U'g', 8.6, "(4.3 5 4.3 5 0 360);8.6 10 8.6 -0.2 (4.5 -0.2 4.1 4 0 -145)"},
    {U'h', 8, "0 14 0 0;0 6 (4 6 4 4 180 0) 8 0"},
    {U'i', 0, "0 10 0 0;(0 13.6 0.3 0.3 0 360)"},
    {U'j', 2, "2 10 2 -1.6 (-0.4 -1.6 2.4 2.4 0 -90);(2 13.6 0.3 0.3 0 360)"},
    {U'k', 7.4, "0 14 0 0;6.8 10 0 4;2.7 6.4 7.4 0"},
    {U'l', 1.8, "0 14 0 2 (1.9 2 1.9 2 180 275)"},
    {U'm', 13.2, "0 10 0 0;0 6.7 (3.3 6.7 3.3 3.3 180 0) 6.6 0;6.6 6.7 (9.9 6.7 3.3 3.3 180 0) 13.2 0"},
    {U'n', 8, "0 10 0 0;0 6 (4 6 4 4 180 0) 8 0"},
    {U'o', 9.2, "(4.6 5 4.6 5 0 360)"},
    {U'p', 8.6, "0 10 0 -4;(4.3 5 4.3 5 0 360)"},
    {U'q', 8.6, "8.6 10 8.6 -4;(4.3 5 4.3 5 0 360)"},
    {U'r', 4.4, "0 10 0 0;0 6 (3.8 6 3.8 4 180 78)"},
    {U's', 6.6, "(3.3 7.55 2.9 2.45 32 270) (3.3 2.55 3.3 2.55 90 -148)"},
    {U't', 4.8, "2 13.4 2 2.6 (4.5 2.6 2.5 2.6 180 280);0 9.8 4.8 9.8"},
    {U'u', 8, "0 10 0 4 (4 4 4 4 180 360) 8 10;8 4 8 0"},
    {U'v', 8.4, "0 10 4.2 0 8.4 10"},
    {U'w', 12.8, "0 10 3.2 0 6.4 9.2 9.6 0 12.8 10"},
    {U'x', 7.6, "0 0 7.4 10;0.2 10 7.6 0"},
    {U'y', 8.6, "0 10 4.3 0;8.6 10 2.6 -4"},
    {U'z', 7.4, "0.2 10 7.2 10 0 0 7.4 0"},
    {U'0', 8.8, "(4.4 7 4.4 7 0 360)"},
    {U'1', 8.8, "1.2 11.2 4.8 14 4.8 0"},
    {U'2', 8.8, "(4.4 9.8 4.1 4.2 168 -40) 0 0 8.8 0"},
    {U'3', 8.8, "(4.2 10.6 3.7 3.4 148 -90) (4.2 3.6 4.4 3.6 90 -148)"},
    {U'4', 8.8, "6.8 0 6.8 14 0 4 8.8 4"},
    {U'5', 8.8, "8 14 1.5 14 0.9 7.6 (4.3 4.6 4.4 4.6 138 -148)"},
    {U'6', 8.8, "6.6 14 1 6.9;(4.4 4.45 4.35 4.45 0 360)"},
    {U'7', 8.8, "0.2 14 8.8 14 3 0"},
    {U'8', 8.8, "(4.4 10.65 3.5 3.35 0 360);(4.4 3.65 4.3 3.65 0 360)"},
    {U'9', 8.8, "2.2 0 7.8 7.1;(4.4 9.55 4.35 4.45 0 360)"},
    {U'.', 0.6, "(0.3 0.4 0.3 0.3 0 360)"},
    {U',', 1, "0.9 0.6 0 -2.4"},
    {U':', 0.6, "(0.3 0.4 0.3 0.3 0 360);(0.3 8.4 0.3 0.3 0 360)"},
    {U';', 1, "0.9 0.6 0 -2.4;(0.8 8.4 0.3 0.3 0 360)"},
    {U'!', 0.6, "0.3 14 0.3 4.4;(0.3 0.4 0.3 0.3 0 360)"},
    {U'?', 7.2, "(3.6 10.4 3.5 3.6 165 -75) 3.6 5.8 3.6 4.2;(3.6 0.4 0.3 0.3 0 360)"},
    {U'-', 4.6, "0 5.4 4.6 5.4"},
    {U'\u2013', 8, "0 5.4 8 5.4"},
    {U'\u2212', 8, "0 6.5 8 6.5"},
    {U'+', 8, "0 6.5 8 6.5;4 2.5 4 10.5"},
    {U'\u00b1', 8, "0 7.8 8 7.8;4 3.8 4 11.8;0 0.6 8 0.6"},
    {U'=', 8, "0 4.4 8 4.4;0 8.6 8 8.6"},
    {U'\u00d7', 6.8, "0 3.1 6.8 9.9;0 9.9 6.8 3.1"},
    {U'\u00b7', 0.6, "(0.3 6.5 0.3 0.3 0 360)"},
    {U'*', 6, "3 14 3 7;0 12.2 6 8.8;0 8.8 6 12.2"},
    {U'/', 6, "0 -2 6 15.5"},
    {U'\\', 6, "0 15.5 6 -2"},
    {U'|', 0, "0 -3.5 0 15.5"},
    {U'(', 2.6, "(6 5.8 6 9.8 125 235)"},
    {U')', 2.6, "(-3.4 5.8 6 9.8 55 -55)"},
    {U'[', 3, "3 15.2 0 15.2 0 -3.6 3 -3.6"},
    {U']', 3, "0 15.2 3 15.2 3 -3.6 0 -3.6"},
    {U'{', 4, "4 15.2 2.6 14.6 2 13 2 7.6 0 5.8 2 4 2 -1.4 2.6 -3 4 -3.6"},
    {U'}', 4, "0 15.2 1.4 14.6 2 13 2 7.6 4 5.8 2 4 2 -1.4 1.4 -3 0 -3.6"},
    {U'<', 8, "8 11 0 6.5 8 2"},
    {U'>', 8, "0 11 8 6.5 0 2"},
    {U'%', 13.4, "(2.9 10.8 2.9 3.2 0 360);(10.5 3.2 2.9 3.2 0 360);10.8 14 2.6 0"},
    {U'_', 9, "0 -2.4 9 -2.4"},
    {U'\'', 0, "0 14 0 10.4"},
    {U'"', 3.4, "0 14 0 10.4;3.4 14 3.4 10.4"},
    {U'`', 2.2, "0 14 2.2 11.4"},
    {U'^', 7, "0 9.5 3.5 14 7 9.5"},
    {U'~', 8.4, "(2.1 6.2 2.1 1.6 180 0) (6.3 6.2 2.1 1.6 180 360)"},
    {U'#', 11, "2 0 4.2 14;6.8 0 9 14;0 4.6 10.4 4.6;0.8 9.4 11 9.4"},
    {U'$', 8.4, "(4.2 10.2 3.7 3.2 35 270) (4.2 3.6 4.2 3.4 90 -145);4.2 15.8 4.2 -1.8"},
    {U'&', 10.4, "10.4 0 2.6 9.4 (4.8 11.3 2.8 2.7 220 -45) 1.6 6 (3.9 3.5 3.9 3.5 135 320) 10 6.4"},
    {U'@', 14, "(7 5.6 3 3.2 0 360);10 9 10 4 (12 4 2 2 180 360) 14 5.6 (7 5.6 7 7.6 0 305)"},
    {U'\u00b0', 4.4, "(2.2 11.8 2.2 2.2 0 360)"},
    {U'\u00c5', 11, "0 0 5.5 12.6 11 0;1.9 4.4 9.1 4.4;(5.5 14.9 2 2 0 360)"},
    {U'\u00b5', 8, "0 10 0 -4;0 4 (4 4 4 4 180 360) 8 10;8 4 8 0"},
    {U'\u03c3', 9.4, "9.4 10 4.4 10;(4.4 5 4.4 5 0 360)"},
    {U'\u03ba', 7, "0 10 0 0;6.6 10 0 4.2;2.5 6.3 7 0"},
};
constexpr Glyph unknown = {U'\ufffd', 8, "0 0 0 14 8 14 8 0 0 0"};

constexpr double em = 20, bearing = 1.65, pen = 1.55;
constexpr double superscript_size = 0.62, superscript_rise = 6.6;

/// A character, and whether it is a small raised form of another one.
struct Shape {
    const Glyph* glyph;
    bool raised;
    double scale() const { return raised ? superscript_size : 1.0; }
    double advance() const { return (glyph->width + 2 * bearing) * scale(); }
};

const Glyph* find_glyph(char32_t code) {
    for (const Glyph& g : glyphs)
        if (g.code == code) return &g;
    return nullptr;
}

Shape find_shape(char32_t code) {
    constexpr std::u32string_view raised =
        U"\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079\u207b";
    constexpr std::u32string_view plain = U"0123456789\u2212";
    if (code == U'\u03bc') code = U'\u00b5';  // the Greek letter and the micro sign look the same
    if (code == U'\u212b') code = U'\u00c5';  // so do the ångström sign and the letter
    const std::size_t i = raised.find(code);
    if (i != raised.npos) return {find_glyph(plain[i]), true};
    return {find_glyph(code), false};
}

/// UTF-8 to code points; a malformed byte becomes one U+FFFD.
std::u32string decode(std::string_view text) {
    std::u32string result;
    for (std::size_t i = 0; i < text.size();) {
        const unsigned char first = static_cast<unsigned char>(text[i++]);
        const int more = first < 0x80   ? 0
                         : first < 0xC2 ? -1
                         : first < 0xE0 ? 1
                         : first < 0xF0 ? 2
                         : first < 0xF5 ? 3
                                        : -1;
        char32_t code = more <= 0 ? first : first & (0x3Fu >> more);
        int left = more;
        while (left > 0 && i < text.size() && (static_cast<unsigned char>(text[i]) & 0xC0) == 0x80) {
            code = code << 6 | (static_cast<unsigned char>(text[i++]) & 0x3Fu);
            --left;
        }
        result += left == 0 ? code : unknown.code;
    }
    return result;
}

Shape shape_of(char32_t code) {
    const Shape shape = find_shape(code);
    return shape.glyph ? shape : Shape{&unknown, false};
}

/// Reads numbers until something else comes; true while there are any.
bool read_number(const char*& at, double& value) {
    char* end = nullptr;
    value = std::strtod(at, &end);
    const bool found = end != at;
    at = end;
    return found;
}

/// The strokes of a glyph as chains of points, in glyph units.
std::vector<std::vector<Vec2d>> strokes_of(const Glyph& glyph) {
    std::vector<std::vector<Vec2d>> strokes(1);
    for (const char* at = glyph.path; *at;) {
        double x = 0, y = 0;
        if (*at == ';') {
            strokes.emplace_back();
            ++at;
        } else if (*at == '(') {
            double arc[6] = {};
            for (double& a : arc) read_number(++at, a);
            ++at;  // the closing bracket
            const int steps = static_cast<int>(std::ceil(std::abs(arc[5] - arc[4]) / 12));
            for (int i = 0; i <= steps; ++i) {
                const double angle = (arc[4] + (arc[5] - arc[4]) * i / steps) * M_PI / 180;
                strokes.back().emplace_back(arc[0] + arc[2] * std::cos(angle),
                                            arc[1] + arc[3] * std::sin(angle));
            }
        } else if (read_number(at, x) && read_number(at, y)) {
            strokes.back().emplace_back(x, y);
        } else {
            ++at;
        }
    }
    return strokes;
}

}  // namespace

bool has_glyph(char32_t code) { return find_shape(code).glyph != nullptr; }

double text_width(std::string_view text, double size) {
    double width = 0;
    for (const char32_t code : decode(text)) width += shape_of(code).advance();
    return width * size / em;
}

void draw_text(Image& image, const Vec2d& position, std::string_view text, double size, const Vec3f& colour,
               TextAlign align, bool upwards) {
    const double unit = size / em;
    double pen_x = align == TextAlign::left     ? 0
                   : align == TextAlign::centre ? -text_width(text, size) / 2
                                                : -text_width(text, size);
    for (const char32_t code : decode(text)) {
        const Shape shape = shape_of(code);
        const double rise = shape.raised ? superscript_rise : 0;
        const auto place = [&](const Vec2d& p) {
            const double x = pen_x + (p.x() + bearing) * shape.scale() * unit;
            const double y = (p.y() * shape.scale() + rise) * unit;
            return Vec2d(position + (upwards ? Vec2d(-y, -x) : Vec2d(x, -y)));
        };
        std::vector<Segment> segments;
        for (const auto& stroke : strokes_of(*shape.glyph))
            for (std::size_t i = 1; i < stroke.size(); ++i)
                segments.push_back({place(stroke[i - 1]), place(stroke[i])});
        draw_segments(image, segments, std::max(1.0, pen * unit), colour);
        pen_x += shape.advance() * unit;
    }
}

}  // namespace vdbgeo
