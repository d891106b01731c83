// Sections through maps: the samples of one plane as a picture, and figures of several.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/view/bars.h"
#include "vdbgeo/view/image.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The samples of a map on a plane across one of its axes, rows from bottom to top. Across z the picture has
/// x to the right and y up, across y x and z, across x y and z.
struct Section {
    int axis = 2;              ///< 0 x, 1 y, 2 z
    int index = 0, count = 1;  ///< which voxel along the axis, from 0, and how many there are
    double place = 0;          ///< of the voxel along the axis, Å
    int width = 0, height = 0;
    double step_x = 1, step_y = 1;  ///< Å
    std::vector<float> values;

    std::string title() const;  ///< "z = 40 of 80"
};

/// The section at a voxel, counted from 0 at the map's first; unset: the middle one. A map without a box is
/// taken where it has active voxels. InvalidInput, telling the range, for a voxel that the map has not.
Section take_section(const DensityMap& map, int axis, std::optional<int> index = {});

/// The voxel, counted as above, whose middle is nearest to a place along the axis, in Å. It may lie outside.
int voxel_at(const DensityMap& map, int axis, double place_A);

/// The densities that black and white stand for.
struct Greys {
    double black = 0, white = 1;
};

/// Those that leave out the lowest and the highest 0.2 % of the samples of some sections; white is above
/// black.
Greys greys_of(const std::vector<const Section*>& sections);
template <class Sections>
Greys greys_of_all(const Sections& sections) {
    std::vector<const Section*> all;
    for (const Section& s : sections) all.push_back(&s);
    return greys_of(all);
}

/// The section as a piece of a picture, of any size: each pixel is the mean of the samples that it covers.
/// NaN is a middle grey.
void draw_section(Image& image, const Section& section, const ColourScale& scale, int left, int top,
                  int width, int height);

/// The bare section in greys, a voxel by as many pixels as give the longer side at least 300 of them, or, of
/// a section of more than 900 voxels, as many voxels by a pixel as give at most 900. Voxels that are not as
/// wide as high keep their shape.
Image section_pixels(const Section& section, const Greys& greys);

/// Where the bilinear interpolation of the samples crosses a value, as straight pieces in each square of
/// four; sample (i, j) is at (i, j), y up. Squares with samples that are not finite are left out.
std::vector<Segment> section_contour(const Section& section, double value);

/// One map's sections in a figure.
struct SectionRow {
    std::string name;  ///< above them; empty: none
    std::vector<Section> sections;
    std::optional<double> isovalue;  ///< whose contour is drawn
};

struct SectionFigureOptions {
    int width = 1600;                     ///< pixels, 160…Image::max_side
    std::optional<std::string> colormap;  ///< one of Colormap::names(); unset: black to white
    std::optional<double> range_min;      ///< of the first colour; unset: 0.2nd percentile of all sections
    std::optional<double> range_max;      ///< of the last colour; unset: 99.8th percentile
    std::string label = "density (the map's units)";  ///< over the bar of colours
    Vec3f contour{0.93f, 0.35f, 0.08f};               ///< sRGB
    Vec3f background{1, 1, 1};                        ///< sRGB
    std::string title;                                ///< above; empty: none

    /// Throws InvalidInput naming the first option out of its range.
    void check() const;
};

/// A row for each map, all sections at one scale and with the same colours, each with its place under it;
/// below them a scale bar and the colours with their densities, contours among them. The picture is as high
/// as that needs, where one row is at most as high as wide. InvalidInput without rows, for a row without
/// sections, and where the picture would be higher than Image::max_side.
Image draw_section_figure(const std::vector<SectionRow>& rows, const SectionFigureOptions& options = {});

}  // namespace vdbgeo
