// What all plots have: a frame with axes, grid lines, words and marks.
#pragma once

#include "vdbgeo/view/plot.h"
#include "vdbgeo/view/ticks.h"

namespace vdbgeo {

/// The rectangle inside the axes, and how values lie in it.
struct PlotFrame {
    double left, right, top, bottom, x_low, x_high, y_low, y_high;
    double x(double value) const { return left + (value - x_low) / (x_high - x_low) * (right - left); }
    double y(double value) const { return bottom - (value - y_low) / (y_high - y_low) * (bottom - top); }
    double width() const { return right - left; }
    double height() const { return bottom - top; }
};

/// Size of the words in pixels.
double em_of(const PlotOptions& options);

/// A drawing of the plot's size and colours without shapes.
Drawing empty_drawing(const PlotOptions& options);

/// The frame but for its left side, which waits for the labels beside it, and for its values. `above` pixels
/// are left free between the title and it.
PlotFrame frame_of(const PlotOptions& options, double em, double above = 0);

/// Sets the left side; the ticks of the x axis.
Ticks finish_frame(PlotFrame& frame, const Ticks& ys, const PlotOptions& options, double em);

/// Ticks of a linear y axis.
Ticks linear_ticks(const PlotFrame& frame, double em);
/// Ticks at the powers of ten; the frame has y as logarithms.
Ticks power_ticks(const PlotFrame& frame, double em);

/// The size, `size` or less, at which the words are no longer than `room`.
double fitting_size(const std::string& text, double size, double room);

void add_grid(Drawing& drawing, const PlotFrame& frame, const Ticks& ys, const Theme& theme);
void add_axes(Drawing& drawing, const PlotFrame& frame, const Ticks& xs, const Ticks& ys, double em,
              const Theme& theme);
/// The title, `above` pixels higher than it would be, and what the axes are called.
void add_words(Drawing& drawing, const PlotFrame& frame, const PlotOptions& options, double em,
               double above = 0);

/// Height of the labels of the marks over the frame: 0 without marks.
double height_of_marks(const PlotOptions& options, double em);
/// The marks on the x axis. InvalidInput for one that is not finite.
void add_marks(Drawing& drawing, const PlotFrame& frame, const PlotOptions& options, double em);

/// One line.
void add_line(Drawing& drawing, const Vec2d& from, const Vec2d& to, double thickness, const Vec3f& colour,
              Drawing::Role role);
/// Words in ink.
void add_text(Drawing& drawing, const Vec2d& position, const std::string& text, double size,
              const Theme& theme, TextAlign align = TextAlign::left, bool upwards = false);

}  // namespace vdbgeo
