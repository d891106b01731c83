// Picture files looked at before they go into a page.
#pragma once

#include <string_view>
#include <utility>

namespace vdbgeo {

/// Whether an SVG file has only shapes and words, and can stand in a page as it is: tags in pairs, no
/// scripts, styles or comments, nothing that refers to anything but a part of itself. What vdbgeo writes is
/// of this kind.
bool is_plain_svg(std::string_view text);

/// Whether a file looks like an SVG at all: its first tag, after the XML declaration and remarks, is <svg>.
bool is_svg(std::string_view text);

/// Width and height of a PNG, from its bytes. InvalidInput where they are no PNG, or a damaged one: the
/// checksum of every chunk is looked at, and nothing may be missing at the end.
std::pair<int, int> png_size(std::string_view bytes);

}  // namespace vdbgeo
