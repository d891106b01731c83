// Where the views, bars and words of a rendered picture lie. Used by render only.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/render.h"

namespace vdbgeo {

/// Axes of an orthographic picture in the world: right × up = towards the viewer.
struct View {
    std::string name;
    Vec3d right, up, towards;
};

/// The views an option names; InvalidInput for an unknown name.
std::vector<View> find_views(const std::string& name);

/// Box of a mesh in a view's axes, relative to the mesh's centre, in Å.
struct ViewBox {
    Vec3d low, high;
};

/// One view's rectangle of pixels; `middle` is the (right, up) position of its centre, in Å.
struct Panel {
    View view;
    int x, y, width, height;
    Vec2d middle;
};

struct Layout {
    int width, height;
    double pixels_per_A;
    double text;  ///< em of the words, pixels
    double caption_top, footer_top, title_base;
    std::vector<Panel> panels;
};

/// Chooses the scale and the rectangles. InvalidInput where the picture is too small to show anything.
Layout arrange(const std::vector<View>& views, const std::vector<ViewBox>& boxes,
               const RenderOptions& options);

/// How a property's values become colours.
struct ColourScale {
    Colormap map;
    double low, high;
    std::string label;

    Vec3f colour(double value) const;
};

/// The scale that the options and the values (their percentiles) ask for.
ColourScale choose_scale(const std::vector<float>& values, const RenderOptions& options);

/// Title, captions with axes, scale bar and colour bar.
void draw_decorations(Image& image, const Layout& layout, const RenderOptions& options,
                      const std::optional<ColourScale>& scale);

}  // namespace vdbgeo
