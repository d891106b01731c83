// What colours mean, where it covers nothing.
#pragma once

#include "vdbgeo/view/plot_frame.h"

namespace vdbgeo {

/// The legend of the curves that have a name.
class Legend {
 public:
    Legend(const std::vector<Curve>& curves, double em) : curves_(curves), em_(em) {}

    /// Draws it into the frame where it keeps clear of the chains of points: as high and as far to the right
    /// as it can be. False, and nothing is drawn, where there is no such place.
    bool add_inside(Drawing& drawing, const PlotFrame& frame, const std::vector<std::vector<Vec2d>>& chains,
                    const Theme& theme) const;

    /// Height of the rows that it takes above a frame of this width.
    double height_above(double width) const;
    /// Draws it as rows that begin at `left`, the first with its baseline 1.1 em below `top`.
    void add_above(Drawing& drawing, double left, double top, double width, const Theme& theme) const;

 private:
    struct Entry {
        const Curve* curve;
        double x, size;
        int row;
    };
    std::vector<Entry> in_rows(double width) const;
    void add_entry(Drawing& drawing, const Curve& curve, double x, double y, double size,
                   const Theme& theme) const;

    const std::vector<Curve>& curves_;
    double em_;
};

}  // namespace vdbgeo
