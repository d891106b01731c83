// A density over a plane of two quantities.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/view/plot.h"

namespace vdbgeo {

/// What there is in each cell of a grid of equal cells over [low, high] × [low, high].
struct PlaneDensity {
    std::size_t side = 0;        ///< cells a side
    std::vector<double> values;  ///< side² of them, x fastest, y from low to high
    double low = 0, high = 1;
};

/// A straight border between regions, in the units of the axes.
struct PlaneLine {
    Vec2d from, to;
};

/// The name of a region: it is written around the first of the places that lies in the plot and where the
/// words cover no line (lines of the other regions; `across` may cover them: names of lines) and no other
/// name, and among these where they hide the least. Left out where there is none.
struct PlaneName {
    std::string text;
    std::vector<Vec2d> places;  ///< for the middle of the words, in the units of the axes
    bool across = false;
};

struct PlanePlot {
    std::vector<PlaneLine> lines;
    std::vector<PlaneName> names;
    std::string bar_label;  ///< beside the colour bar: what the values are
    std::string note;       ///< in the upper left corner
    double powers = 3;      ///< of ten that the colours span, below the greatest value; 0.5…12
};

/// The density as coloured cells, by the logarithm of the values, with a colour bar; both axes have the same
/// scale. Cells of less than the colours span have the first colour, cells of 0 none. Options as other plots
/// have, but for bars, counts and x_low; marks are left out.
/// Errors: InvalidInput where the number of values is not side² (side ≥ 1), for a value that is negative or
/// not finite, unless low < high are finite, for powers out of range.
Drawing plot_plane(const PlaneDensity& density, const PlanePlot& plane, const PlotOptions& options = {});

}  // namespace vdbgeo
