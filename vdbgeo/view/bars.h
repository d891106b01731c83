// Words, axes and bars in pictures. Used by pictures of surfaces and of sections.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/image.h"

namespace vdbgeo {

/// The colour of words and lines that can be read on this background.
Vec3f ink_on(const Vec3f& background);

/// The size at which `text` is no wider than `room`, at most `size`.
double fitting(const std::string& text, double size, double room);

/// How values become colours.
struct ColourScale {
    std::optional<Colormap> map;  ///< unset: black to white
    double low = 0, high = 1;
    std::string label;
    std::map<int, std::string> names{};  ///< of classes; empty: their numbers are shown

    Vec3f colour(double value) const;
};

/// A rectangle that bars and words may fill, from `left` to `right` below `top`, and the size of the words.
struct BarStrip {
    double left, right, top, em;
};
constexpr double bar_height = 4.4;  ///< of the strip that a scale bar or a colour bar needs, ems

/// A bar of round length in Å, nm or µm, at most `longest` pixels, and its length under it.
void draw_scale_bar(Image& image, const BarStrip& strip, double longest, double pixels_per_A,
                    const Vec3f& colour);

/// The colours with ticks and the label; of classes that have names a legend.
void draw_colour_bar(Image& image, const BarStrip& strip, const ColourScale& scale, const Vec3f& colour);

/// The directions of x, y, z in a picture with these axes, and its name beside them. `corner` is the
/// lower left one, in pixels.
void draw_axes(Image& image, const Vec2d& corner, const Vec3d& right, const Vec3d& up,
               const std::string& name, double em, const Vec3f& colour);

}  // namespace vdbgeo
