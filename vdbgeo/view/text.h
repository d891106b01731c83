// Text in pictures, drawn with a stroke font of our own.
#pragma once

#include <string_view>

#include "vdbgeo/view/image.h"

namespace vdbgeo {

enum class TextAlign { left, centre, right };

/// Width of UTF-8 text in pixels; `size` is the em in pixels, capital letters are 0.7 of it high.
double text_width(std::string_view text, double size);

/// Height of capital letters and digits over the baseline, in pixels.
inline double cap_height(double size) { return 0.7 * size; }

/// Draws UTF-8 text whose baseline starts (or has its middle, or ends) at `position`, antialiased at any
/// size. `upwards` turns it by 90° to be read from bottom to top. The font knows printable ASCII and Å µ ° ±
/// × · − – σ κ ⁰ ¹ ² ³ ⁴ ⁵ ⁶ ⁷ ⁸ ⁹ ⁻; anything else is shown as a box.
void draw_text(Image& image, const Vec2d& position, std::string_view text, double size, const Vec3f& colour,
               TextAlign align = TextAlign::left, bool upwards = false);

/// Whether the font has this character.
bool has_glyph(char32_t code);

}  // namespace vdbgeo
