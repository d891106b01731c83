#include "vdbgeo/view/page_images.h"

#include <fmt/format.h>
#include <zlib.h>

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; }

void skip_blanks(std::string_view& text) {
    while (!text.empty() && is_blank(text[0])) text.remove_prefix(1);
}

/// A name of letters, digits, '-', ':' and '_' from the start of `text`.
std::string take_name(std::string_view& text) {
    std::size_t n = 0;
    const auto good = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
               c == ':' || c == '_';
    };
    while (n < text.size() && good(text[n])) ++n;
    std::string name(text.substr(0, n));
    text.remove_prefix(n);
    return name;
}

/// Past the XML declaration and remarks before the first tag.
std::string_view past_prolog(std::string_view text) {
    if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
    for (;;) {
        skip_blanks(text);
        const bool declaration = text.substr(0, 2) == "<?", remark = text.substr(0, 4) == "<!--";
        const std::size_t end = declaration ? text.find("?>") : remark ? text.find("-->") : text.npos;
        if (end == text.npos) return text;
        text.remove_prefix(end + (declaration ? 2 : 3));
    }
}

bool is_plain_attribute(const std::string& name, std::string_view value) {
    static const std::set<std::string> names{"xmlns",
                                             "viewBox",
                                             "width",
                                             "height",
                                             "role",
                                             "aria-label",
                                             "aria-labelledby",
                                             "aria-hidden",
                                             "class",
                                             "id",
                                             "x",
                                             "y",
                                             "x1",
                                             "y1",
                                             "x2",
                                             "y2",
                                             "cx",
                                             "cy",
                                             "r",
                                             "rx",
                                             "ry",
                                             "d",
                                             "points",
                                             "dx",
                                             "dy",
                                             "transform",
                                             "fill",
                                             "fill-opacity",
                                             "fill-rule",
                                             "stroke",
                                             "stroke-width",
                                             "stroke-opacity",
                                             "stroke-linecap",
                                             "stroke-linejoin",
                                             "stroke-dasharray",
                                             "stroke-miterlimit",
                                             "opacity",
                                             "font-family",
                                             "font-size",
                                             "font-weight",
                                             "font-style",
                                             "text-anchor",
                                             "dominant-baseline",
                                             "baseline-shift",
                                             "clip-path",
                                             "preserveAspectRatio",
                                             "version",
                                             "shape-rendering",
                                             "vector-effect",
                                             "letter-spacing",
                                             "xml:space",
                                             "lang"};
    if (!names.count(name) || value.find_first_of("<&\\") != value.npos) {
        // Words may have entities.
        if (name != "aria-label" || value.find('<') != value.npos) return false;
    }
    if (name == "xmlns") return value == "http://www.w3.org/2000/svg";
    const std::size_t link = value.find("url(");
    return link == value.npos ||
           (value.substr(link, 5) == "url(#" && value.find("url(", link + 1) == value.npos);
}

bool is_plain_tag(const std::string& name) {
    static const std::set<std::string> names{"svg",     "title", "desc",   "g",       "path",
                                             "line",    "rect",  "circle", "ellipse", "polyline",
                                             "polygon", "text",  "tspan",  "defs",    "clipPath"};
    return names.count(name) > 0;
}

/// The attributes and the end of a tag; whether the element is empty comes back in `closed`.
bool take_attributes(std::string_view& text, bool& closed) {
    std::set<std::string> seen;
    for (;;) {
        const bool apart = !text.empty() && is_blank(text[0]);
        skip_blanks(text);
        closed = text.substr(0, 2) == "/>";
        if (closed || text.substr(0, 1) == ">") {
            text.remove_prefix(closed ? 2 : 1);
            return true;
        }
        const std::string name = take_name(text);
        if (!apart || name.empty() || text.substr(0, 2) != "=\"" || !seen.insert(name).second) return false;
        text.remove_prefix(2);
        const std::size_t end = text.find('"');
        if (end == text.npos || !is_plain_attribute(name, text.substr(0, end))) return false;
        text.remove_prefix(end + 1);
    }
}

std::uint32_t big_endian(std::string_view bytes, std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
}

}  // namespace

bool is_svg(std::string_view text) {
    text = past_prolog(text);
    return text.substr(0, 4) == "<svg" && text.size() > 4 && (is_blank(text[4]) || text[4] == '>');
}

bool is_plain_svg(std::string_view text) {
    if (!is_svg(text)) return false;
    text = past_prolog(text);
    std::vector<std::string> open;
    while (!text.empty()) {
        const std::size_t tag = text.find('<');
        if (open.empty()) {  // before and behind the root: blanks
            skip_blanks(text);
            if (text.empty()) return true;
            if (text[0] != '<') return false;
        } else {
            if (tag == text.npos) return false;
            text.remove_prefix(tag);
        }
        text.remove_prefix(1);
        if (text.substr(0, 1) == "/") {
            text.remove_prefix(1);
            if (open.empty() || take_name(text) != open.back()) return false;
            skip_blanks(text);
            if (text.substr(0, 1) != ">") return false;
            text.remove_prefix(1);
            open.pop_back();
            if (!open.empty()) continue;
            skip_blanks(text);
            return text.empty();
        }
        const std::string name = take_name(text);
        bool closed = false;
        if (!is_plain_tag(name) || (name == "svg" && !open.empty()) || !take_attributes(text, closed))
            return false;
        if (!closed) open.push_back(name);
    }
    return false;
}

std::pair<int, int> png_size(std::string_view bytes) {
    const auto damaged = [](const std::string& why) {
        return InvalidInput("not a whole PNG picture: " + why);
    };
    if (bytes.substr(0, 8) != std::string_view("\x89PNG\r\n\x1A\n", 8)) throw damaged("it begins otherwise");
    std::pair<int, int> size{0, 0};
    for (std::size_t at = 8; at + 12 <= bytes.size();) {
        const std::size_t length = big_endian(bytes, at);
        const std::string_view kind = bytes.substr(at + 4, 4);
        if (length > bytes.size() - at - 12) break;
        const auto* checked = reinterpret_cast<const Bytef*>(bytes.data() + at + 4);
        if (crc32(0, checked, static_cast<uInt>(length + 4)) != big_endian(bytes, at + 8 + length))
            throw damaged(fmt::format("the checksum at byte {} is another", at + 8 + length));
        if (at == 8) {
            if (kind != "IHDR" || length != 13) throw damaged("it has no header");
            size = {static_cast<int>(big_endian(bytes, 16)), static_cast<int>(big_endian(bytes, 20))};
            if (size.first < 1 || size.second < 1) throw damaged("it has no pixels");
        }
        if (kind == "IEND") return size;
        at += length + 12;
    }
    throw damaged("its end is missing");
}

}  // namespace vdbgeo
