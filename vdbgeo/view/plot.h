// Simple plots.
#pragma once

#include <string>
#include <vector>

#include "vdbgeo/view/image.h"

namespace vdbgeo {

struct PlotOptions {
    std::string title, x_label, y_label;  ///< empty: none
    int width = 1000, height = 640;       ///< pixels, each 160…Image::max_side
    Vec3f bars{0.33f, 0.53f, 0.72f};      ///< sRGB
    double x_low = 0;                     ///< where the x axis of curves begins

    /// Throws InvalidInput naming the first option out of its range.
    void check() const;
};

/// A histogram: counts[i] as a bar over [lo + i·w, lo + (i+1)·w], w = (hi − lo) / number of counts. The count
/// axis starts at 0. All counts 0 give empty axes.
/// Errors: InvalidInput without counts, for a count that is negative or not finite, unless lo < hi are
/// finite.
Image plot_histogram(const std::vector<double>& counts, double lo, double hi,
                     const PlotOptions& options = {});

/// A curve: points joined by lines, left out where y is not finite (or not positive on a logarithmic axis).
struct Curve {
    std::string name;  ///< in the legend; empty: not there
    std::vector<double> x, y;
    Vec3f colour{0.33f, 0.53f, 0.72f};  ///< sRGB
};

/// Curves over a linear x axis from x_low, with y linear or by powers of ten (at most eight of them, the
/// highest). Errors: InvalidInput for a curve whose x and y differ in number, or whose x is not finite or
/// below x_low.
Image plot_curves(const std::vector<Curve>& curves, bool logarithmic, const PlotOptions& options = {});

}  // namespace vdbgeo
