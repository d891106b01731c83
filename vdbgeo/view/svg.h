// Drawings as SVG.
#pragma once

#include <filesystem>
#include <string>

#include "vdbgeo/view/drawing.h"

namespace vdbgeo {

/// The drawing as one <svg> element (SVG 1.1, UTF-8): it stands alone in any viewer, and in a page. Text is
/// <text> in the viewer's sans-serif font. Every shape has its colours as attributes; what is drawn with a
/// colour of the theme has a class besides, by which a page can recolour it: ink-text (fill), ink-line
/// (stroke), grid (stroke), paper (fill). Text that XML cannot hold (control characters, broken UTF-8)
/// becomes U+FFFD. The same drawing gives the same bytes.
std::string svg_text(const Drawing& drawing);

/// Writes that as a file. IoError where it cannot be written whole.
void write_svg(const Drawing& drawing, const std::filesystem::path& path);

}  // namespace vdbgeo
