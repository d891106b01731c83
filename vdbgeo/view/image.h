// A picture in memory, and antialiased shapes drawn into it.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

using Vec2d = Eigen::Vector2d;

/// RGB, 8 bits a channel, rows from top to bottom without gaps. Colours are sRGB in 0…1 wherever they are
/// given as Vec3f. Positions are in pixels, x to the right and y down; pixel (i, j) covers [i, i+1) × [j,
/// j+1).
struct Image {
    static constexpr int max_side = 16384;

    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;  ///< 3 · width · height bytes

    Image() = default;
    /// One colour everywhere. InvalidInput unless both sides lie in 1…max_side.
    Image(int width, int height, const Vec3f& background = Vec3f::Ones());

    std::uint8_t* at(int x, int y) { return pixels.data() + offset(x, y); }
    const std::uint8_t* at(int x, int y) const { return pixels.data() + offset(x, y); }
    void set(int x, int y, const Vec3f& colour);

 private:
    std::size_t offset(int x, int y) const {
        return 3 *
               (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
    }
};

/// The nearest 8-bit value of a channel; what lies outside 0…1 is clamped.
std::uint8_t to_byte(float channel);

/// Copies `piece` with its upper left corner at pixel (x, y); what lies outside is left out.
void paste(Image& image, const Image& piece, int x, int y);

/// The picture at this width (its height follows), each pixel the mean of the light that falls on it. A width
/// that is not smaller gives the picture back. InvalidInput unless `width` is at least 1.
Image scaled_down(const Image& image, int width);

/// Mixes `colour` into one pixel: cover 0 leaves it, 1 replaces it. Pixels outside the image are ignored.
void blend(Image& image, int x, int y, const Vec3f& colour, double cover);

/// Fills [x0, x1] × [y0, y1]; fractional edges cover their pixels in part. Opacity 0 leaves what is there.
void fill_rectangle(Image& image, double x0, double y0, double x1, double y1, const Vec3f& colour,
                    double opacity = 1);

/// A line with round ends.
struct Segment {
    Vec2d from, to;
};

/// Draws the union of the segments, `thickness` pixels wide: where they overlap nothing is painted twice.
void draw_segments(Image& image, const std::vector<Segment>& segments, double thickness, const Vec3f& colour);
void draw_line(Image& image, const Vec2d& from, const Vec2d& to, double thickness, const Vec3f& colour);

}  // namespace vdbgeo
