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

    /// Throws InvalidInput naming the first option out of its range.
    void check() const;
};

/// A histogram: counts[i] as a bar over [lo + i·w, lo + (i+1)·w], w = (hi − lo) / number of counts. The count
/// axis starts at 0. All counts 0 give empty axes.
/// Errors: InvalidInput without counts, for a count that is negative or not finite, unless lo < hi are
/// finite.
Image plot_histogram(const std::vector<double>& counts, double lo, double hi,
                     const PlotOptions& options = {});

}  // namespace vdbgeo
