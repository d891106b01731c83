// Plots as files: what their names may be, how they look, and the isovalue that they mark.
#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "vdbgeo/view/drawing.h"
#include "vdbgeo/view/theme.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo::app {

/// UsageError unless a plot can be written under this name: .png or .svg. An empty name is none.
void check_plot_output(const std::string& path);

/// Writes a plot as its ending says. UsageError as check_plot_output, IoError where it cannot be written.
void write_drawing(const Drawing& drawing, const std::string& path);

/// --dark, for commands that draw plots.
struct PlotFlags {
    bool dark = false;

    void add(CLI::App& app);
    Theme theme() const { return dark ? Theme::dark() : Theme::light(); }
    /// UsageError where --dark was given and no plot was asked for; `flags` names those that ask for one.
    void check(bool drawn, const std::string& flags) const;
};

/// A surface's level, and how it was found, for the line that marks it.
struct MarkedLevel {
    double isovalue = 0;
    std::string label;  ///< "isovalue 0.12 (mean + 3σ)"
};

/// The label that names an isovalue and its distance from the mean in standard deviations.
MarkedLevel marked_level(double isovalue, const Statistics& statistics);

}  // namespace vdbgeo::app
