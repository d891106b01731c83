// A picture of shapes, before it is pixels or a file: plots draw into it.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "vdbgeo/view/image.h"
#include "vdbgeo/view/text.h"

namespace vdbgeo {

/// Shapes in the order in which they are painted. Positions and lengths are in pixels, x to the right and y
/// down, as in Image; colours are sRGB.
struct Drawing {
    /// What a shape is drawn with: a colour of its own, or one of the theme's, which a page may replace.
    enum class Role { own, ink, grid, paper };

    /// Chains of points with round ends and joints. Where the chains of one shape overlap nothing is painted
    /// twice.
    struct Lines {
        std::vector<std::vector<Vec2d>> chains;
        double thickness = 1;
        Vec3f colour = Vec3f::Zero();
        Role role = Role::own;
    };
    /// Filled rectangles of one colour that do not overlap.
    struct Boxes {
        struct Box {
            double x0, y0, x1, y1;
        };
        std::vector<Box> boxes;
        Vec3f colour = Vec3f::Zero();
        Role role = Role::own;
        double opacity = 1;
    };
    /// One line of text, placed as draw_text does.
    struct Text {
        Vec2d position;
        std::string text;
        double size = 16;
        Vec3f colour = Vec3f::Zero();
        TextAlign align = TextAlign::left;
        bool upwards = false;
        Role role = Role::ink;
    };
    using Shape = std::variant<Lines, Boxes, Text>;

    int width = 0, height = 0;
    std::string title;  ///< what the picture is called; drawn only where a shape draws it
    Vec3f paper = Vec3f::Ones();
    std::vector<Shape> shapes;
};

/// The drawing as pixels, with the stroke font. InvalidInput for a size that no Image has.
Image rasterise(const Drawing& drawing);

}  // namespace vdbgeo
