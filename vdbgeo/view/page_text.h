// Text as a page needs it: JSON, HTML, base64.
#pragma once

#include <string>
#include <string_view>

namespace vdbgeo {

/// Bytes as base64 (RFC 4648, with padding), for data: addresses.
std::string base64(std::string_view bytes);

/// Text as a JSON string, with its quotes. "</" becomes "<\/", so that it can stand within a script of a
/// page. What is not UTF-8 becomes U+FFFD.
std::string json_string(std::string_view text);

/// A number as JSON: the shortest text that gives the same double; null where it is not finite.
std::string json_number(double value);

/// Text with every piece that is not UTF-8 made U+FFFD, and control characters, but for tab and line feed,
/// taken out.
std::string valid_utf8(std::string_view text);

/// Text for the inside of an element or of an attribute in double quotes, as valid_utf8 has it.
std::string html_text(std::string_view text);

}  // namespace vdbgeo
