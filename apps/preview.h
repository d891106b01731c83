// A picture that shows what a command did to a map: sections through the middle and power spectra.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/view/drawing.h"
#include "vdbgeo/view/sections.h"
#include "vdbgeo/view/theme.h"
#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/power_spectrum.h"

namespace vdbgeo::app {

/// Collects maps, which can be changed or dropped afterwards, and draws a row for each: the sections through
/// the middle across z, y and x, all at one scale; below them the radial power spectra, logarithmic, in one
/// plot.
class Preview {
 public:
    enum class Greys {
        as_first,  ///< black and white stand for the same densities as in the first row
        own        ///< for those of the row itself
    };

    /// Takes the sections and the spectrum of a map.
    void add(const std::string& name, const DensityMap& map, Greys scale, const Progress& progress = {});

    Image draw() const;
    /// The radial power spectra of all maps in one plot.
    Drawing plot_spectra(const Theme& theme, int width = 1000, int height = 640) const;
    /// Draws and writes the PNG.
    void write(const std::string& path) const;

 private:
    struct Row {
        std::string name;
        std::array<Section, 3> sections;
        vdbgeo::Greys greys;
        PowerSpectrum spectrum;
    };

    Image draw_spectra(int width) const;

    std::vector<Row> rows_;
};

}  // namespace vdbgeo::app
