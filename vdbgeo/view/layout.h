// Where the views, bars and words of a rendered picture lie. Used by render only.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/view/bars.h"
#include "vdbgeo/view/render.h"

namespace vdbgeo {

/// Axes of an orthographic picture in the world: right × up = towards the viewer.
struct View {
    std::string name;
    Vec3d right, up, towards;
};

/// The views an option names; InvalidInput for an unknown name.
std::vector<View> find_views(const std::string& name);

/// The view after the specimen was turned by this angle about the picture's upright axis of the world (z, or
/// y where the view looks along z), counter-clockwise seen from above.
View turned(const View& view, double radians);

/// Box of a mesh in a view's axes, relative to the mesh's centre, in Å.
struct ViewBox {
    Vec3d low, high;

    Vec2d middle() const { return ((low + high) / 2).head<2>(); }
};

/// What is to be drawn at one place: a mesh in a view.
struct Cell {
    View view;
    ViewBox box;
    Vec2d middle;       ///< (right, up) of the place's centre, relative to the mesh's centre, in Å
    std::string label;  ///< above it; empty: none
};

/// One cell's rectangle of pixels.
struct Panel {
    View view;
    int x, y, width, height;
    Vec2d middle;  ///< as the cell's
    std::string label;
    bool captioned;  ///< the view's axes are shown below it
};

struct Layout {
    int width, height;
    double pixels_per_A;
    double text;  ///< em of the words, pixels
    double caption_top, footer_top, title_base;
    std::vector<Panel> panels;  ///< one for each cell
};

/// Chooses the scale and the rectangles of cells in rows of `columns`. InvalidInput where the picture is too
/// small to show anything.
Layout arrange(const std::vector<Cell>& cells, std::size_t columns, const RenderOptions& options);

/// The scale that the options and the values (their percentiles) ask for.
ColourScale choose_scale(const std::vector<float>& values, const RenderOptions& options);

/// Title, labels, captions with axes, scale bar and colour bar.
void draw_decorations(Image& image, const Layout& layout, const RenderOptions& options,
                      const std::optional<ColourScale>& scale);

}  // namespace vdbgeo
