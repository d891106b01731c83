#include "vdbgeo/view/page_text.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

namespace vdbgeo {
namespace {

/// Bytes of the well-formed UTF-8 sequence (Unicode, table 3-7) at the start of `text`, 0 where there is
/// none.
std::size_t sequence(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char lead = byte(0);
    if (lead < 0x80) return 1;
    const std::size_t length = lead < 0xC2 ? 0 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : lead < 0xF5 ? 4 : 0;
    if (length == 0 || text.size() < length) return 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((byte(i) & 0xC0) != 0x80) return 0;
    const unsigned char second = byte(1);
    if ((lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) ||
        (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second > 0x8F))
        return 0;
    return length;
}

}  // namespace

std::string base64(std::string_view bytes) {
    constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t group = 0;
        for (std::size_t k = 0; k < 3; ++k)
            group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k)
            text += i + k < bytes.size() + 1 ? digits[group >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

std::string valid_utf8(std::string_view text) {
    std::string valid;
    valid.reserve(text.size());
    while (!text.empty()) {
        const std::size_t length = sequence(text);
        const auto lead = static_cast<unsigned char>(text[0]);
        if (length == 0)
            valid += "\xEF\xBF\xBD";
        else if (lead >= 0x20 ? lead != 0x7F : lead == '\t' || lead == '\n')
            valid += text.substr(0, length);
        text.remove_prefix(length ? length : 1);
    }
    return valid;
}

std::string json_string(std::string_view text) {
    std::string quoted = "\"";
    for (const char c : valid_utf8(text)) {
        if (c == '/' && quoted.back() == '<')
            quoted += "\\/";
        else if (c == '"' || c == '\\')
            quoted += std::string("\\") + c;
        else if (c == '\n' || c == '\t')
            quoted += c == '\n' ? "\\n" : "\\t";
        else
            quoted += c;
    }
    // A script's text must not begin a comment either.
    for (std::size_t at = 0; (at = quoted.find("<!", at)) != std::string::npos;)
        quoted.replace(at, 2, "\\u003c!");
    return quoted + '"';
}

std::string json_number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "null"; }

std::string html_text(std::string_view text) {
    std::string safe;
    safe.reserve(text.size());
    for (const char c : valid_utf8(text)) {
        if (c == '&')
            safe += "&amp;";
        else if (c == '<')
            safe += "&lt;";
        else if (c == '>')
            safe += "&gt;";
        else if (c == '"')
            safe += "&quot;";
        else if (c == '\'')
            safe += "&#39;";
        else
            safe += c;
    }
    return safe;
}

}  // namespace vdbgeo
