// Simple plots.
#pragma once

#include <string>
#include <vector>

#include "vdbgeo/view/drawing.h"
#include "vdbgeo/view/theme.h"

namespace vdbgeo {

/// A value of the x axis that a line across the plot marks; left out where it lies beyond the axis.
struct PlotMark {
    double value = 0;
    std::string label;  ///< above the line
};

struct PlotOptions {
    std::string title, x_label, y_label;  ///< empty: none
    int width = 1000, height = 640;       ///< pixels, each 160…Image::max_side
    Vec3f bars{0.33f, 0.53f, 0.72f};      ///< sRGB
    double x_low = 0;                     ///< where the x axis of curves begins
    bool logarithmic_counts = false;      ///< histograms: counts by powers of ten, bars from below the least
    std::vector<PlotMark> marks;
    Theme theme = Theme::light();

    /// Throws InvalidInput naming the first option out of its range.
    void check() const;
};

/// A histogram: counts[i] as a bar over [lo + i·w, lo + (i+1)·w], w = (hi − lo) / number of counts. The count
/// axis starts at 0; a logarithmic one has at most eight powers of ten, the highest. All counts 0 give empty
/// axes.
/// Errors: InvalidInput without counts, for a count that is negative or not finite, unless lo < hi are
/// finite, for a mark that is not.
Drawing plot_histogram(const std::vector<double>& counts, double lo, double hi,
                       const PlotOptions& options = {});

/// A curve: points joined by lines, left out where y is not finite (or not positive on a logarithmic axis).
struct Curve {
    std::string name;  ///< in the legend; empty: not there
    std::vector<double> x, y;
    Vec3f colour{0.33f, 0.53f, 0.72f};  ///< sRGB
};

/// Curves over a linear x axis from x_low, with y linear or by powers of ten (at most eight of them, the
/// highest). The legend stands inside where it covers no curve, top right if it can be, else above the plot.
/// Errors: InvalidInput for a curve whose x and y differ in number, or whose x is not finite or
/// below x_low, for a mark that is not finite.
Drawing plot_curves(const std::vector<Curve>& curves, bool logarithmic, const PlotOptions& options = {});

}  // namespace vdbgeo
