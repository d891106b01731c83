#include "vdbgeo/view/image.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/view/colormap.h"

namespace vdbgeo {
namespace {

double distance_to(const Segment& s, const Vec2d& p) {
    const Vec2d along = s.to - s.from;
    const double length2 = along.squaredNorm();
    const double t = length2 > 0 ? std::clamp((p - s.from).dot(along) / length2, 0.0, 1.0) : 0.0;
    return (s.from + t * along - p).norm();
}

/// The first and the last pixel that [low, high] touches inside [0, size).
std::pair<int, int> touched(double low, double high, int size) {
    return {static_cast<int>(std::clamp(std::floor(low), 0.0, double(size))),
            static_cast<int>(std::clamp(std::ceil(high), 0.0, double(size)))};
}

}  // namespace

Image::Image(int w, int h, const Vec3f& background) : width(w), height(h) {
    if (w < 1 || h < 1 || w > max_side || h > max_side)
        throw InvalidInput(
            fmt::format("picture of {} x {} pixels: each side must be 1 to {}", w, h, max_side));
    pixels.resize(3 * static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
    const std::uint8_t rgb[3] = {to_byte(background[0]), to_byte(background[1]), to_byte(background[2])};
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = rgb[i % 3];
}

void Image::set(int x, int y, const Vec3f& colour) {
    for (int c = 0; c < 3; ++c) at(x, y)[c] = to_byte(colour[c]);
}

std::uint8_t to_byte(float channel) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(channel, 0.0f, 1.0f) * 255.0f));
}

void paste(Image& image, const Image& piece, int x, int y) {
    const int left = std::max(0, -x), right = std::min(piece.width, image.width - x);
    if (left >= right) return;
    for (int row = std::max(0, -y); row < std::min(piece.height, image.height - y); ++row)
        std::copy_n(piece.at(left, row), 3 * (right - left), image.at(x + left, y + row));
}

Image scaled_down(const Image& image, int width) {
    if (width < 1) throw InvalidInput(fmt::format("a picture cannot be {} pixels wide", width));
    if (width >= image.width) return image;
    const double step = static_cast<double>(image.width) / width;
    Image small(width, std::max(1, static_cast<int>(std::lround(image.height / step))));
    const double down = static_cast<double>(image.height) / small.height;
    std::array<double, 256> light;
    for (std::size_t i = 0; i < light.size(); ++i)
        light[i] = double(srgb_to_linear(static_cast<float>(i) / 255));
    const auto share = [](int i, double from, double to) {
        return std::min(to, i + 1.0) - std::max(from, double(i));
    };
    parallel_for(static_cast<std::size_t>(small.height), 8, [&](std::size_t row) {
        const double top = static_cast<double>(row) * down, bottom = top + down;
        for (int x = 0; x < width; ++x) {
            const double left = x * step, right = left + step;
            Eigen::Vector3d sum = Eigen::Vector3d::Zero();
            double area = 0;
            for (int j = static_cast<int>(top); j < image.height && j < bottom; ++j)
                for (int i = static_cast<int>(left); i < image.width && i < right; ++i) {
                    const double part = share(j, top, bottom) * share(i, left, right);
                    const std::uint8_t* p = image.at(i, j);
                    sum += part * Eigen::Vector3d(light[p[0]], light[p[1]], light[p[2]]);
                    area += part;
                }
            std::uint8_t* out = small.at(x, static_cast<int>(row));
            for (int c = 0; c < 3; ++c) out[c] = to_byte(linear_to_srgb(static_cast<float>(sum[c] / area)));
        }
    });
    return small;
}

void blend(Image& image, int x, int y, const Vec3f& colour, double cover) {
    if (x < 0 || y < 0 || x >= image.width || y >= image.height || !(cover > 0)) return;
    const float c = static_cast<float>(std::min(cover, 1.0));
    std::uint8_t* pixel = image.at(x, y);
    for (int k = 0; k < 3; ++k) pixel[k] = to_byte(pixel[k] / 255.0f * (1 - c) + colour[k] * c);
}

void fill_rectangle(Image& image, double x0, double y0, double x1, double y1, const Vec3f& colour,
                    double opacity) {
    const auto [left, right] = touched(x0, x1, image.width);
    const auto [top, bottom] = touched(y0, y1, image.height);
    for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x) {
            const double wide = std::min(x1, x + 1.0) - std::max(x0, double(x));
            const double high = std::min(y1, y + 1.0) - std::max(y0, double(y));
            blend(image, x, y, colour, std::max(wide, 0.0) * std::max(high, 0.0) * opacity);
        }
}

void draw_segments(Image& image, const std::vector<Segment>& segments, double thickness,
                   const Vec3f& colour) {
    if (segments.empty()) return;
    Vec2d low = segments[0].from, high = low;
    for (const Segment& s : segments) {
        low = low.cwiseMin(s.from).cwiseMin(s.to);
        high = high.cwiseMax(s.from).cwiseMax(s.to);
    }
    const double half = thickness / 2, reach = half + 1;
    const auto [left, right] = touched(low.x() - reach, high.x() + reach, image.width);
    const auto [top, bottom] = touched(low.y() - reach, high.y() + reach, image.height);
    if (left >= right || top >= bottom) return;
    // Each segment looks only at the pixels that it reaches.
    const auto width = static_cast<std::size_t>(right - left);
    std::vector<double> nearest(width * static_cast<std::size_t>(bottom - top), reach);
    for (const Segment& s : segments) {
        const Vec2d lower = s.from.cwiseMin(s.to), upper = s.from.cwiseMax(s.to);
        const auto [x0, x1] = touched(lower.x() - reach, upper.x() + reach, image.width);
        const auto [y0, y1] = touched(lower.y() - reach, upper.y() + reach, image.height);
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x) {
                double& d =
                    nearest[static_cast<std::size_t>(y - top) * width + static_cast<std::size_t>(x - left)];
                d = std::min(d, distance_to(s, Vec2d(x + 0.5, y + 0.5)));
            }
    }
    for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x) {
            const double d =
                nearest[static_cast<std::size_t>(y - top) * width + static_cast<std::size_t>(x - left)];
            // A line thinner than a pixel is a pixel wide and fainter.
            const double cover = std::clamp(std::max(half, 0.5) - d + 0.5, 0.0, 1.0);
            blend(image, x, y, colour, cover * std::min(1.0, thickness));
        }
}

void draw_line(Image& image, const Vec2d& from, const Vec2d& to, double thickness, const Vec3f& colour) {
    draw_segments(image, {{from, to}}, thickness, colour);
}

}  // namespace vdbgeo
