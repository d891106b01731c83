#include "vdbgeo/view/colormap.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

/// A colour by lightness 0…1, chroma, and hue in degrees.
struct Lch {
    double lightness, chroma, hue;
};

Vec3d to_lab(const Lch& c) {
    const double hue = c.hue * M_PI / 180;
    return {c.lightness, c.chroma * std::cos(hue), c.chroma * std::sin(hue)};
}

/// OKLab → sRGB, by the matrices of Ottosson's definition.
Vec3f to_srgb(const Vec3d& lab) {
    const auto cube = [](double v) { return v * v * v; };
    const double l = cube(lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2]);
    const double m = cube(lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2]);
    const double s = cube(lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2]);
    const double rgb[3] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                           -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                           -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
    Vec3f result;
    for (int c = 0; c < 3; ++c) result[c] = linear_to_srgb(static_cast<float>(std::clamp(rgb[c], 0.0, 1.0)));
    return result;
}

/// Catmull–Rom curve through evenly spaced control points.
Vec3d curve(const std::vector<Vec3d>& points, double t) {
    const int last = static_cast<int>(points.size()) - 1;
    const double x = std::clamp(t, 0.0, 1.0) * last;
    const int i = std::min(static_cast<int>(x), last - 1);
    const auto at = [&](int k) {  // beyond the ends the curve goes straight on
        const auto& p = points;
        if (k < 0) return Vec3d(2 * p[0] - p[1]);
        if (k > last)
            return Vec3d(2 * p[static_cast<std::size_t>(last)] - p[static_cast<std::size_t>(last - 1)]);
        return p[static_cast<std::size_t>(k)];
    };
    const double f = x - i;
    const Vec3d a = at(i - 1), b = at(i), c = at(i + 1), d = at(i + 2);
    return 0.5 *
           (2 * b + (c - a) * f + (2 * a - 5 * b + 4 * c - d) * f * f + (3 * b - a - 3 * c + d) * f * f * f);
}

std::vector<Vec3f> sample(const std::vector<Lch>& control) {
    constexpr int steps = 256;
    std::vector<Vec3d> lab;
    for (const Lch& c : control) lab.push_back(to_lab(c));
    std::vector<Vec3f> table;
    for (int i = 0; i <= steps; ++i) table.push_back(to_srgb(curve(lab, double(i) / steps)));
    return table;
}

const std::vector<Lch> sequential_points = {{0.34, 0.120, 285}, {0.46, 0.110, 252}, {0.58, 0.095, 215},
                                            {0.70, 0.115, 165}, {0.82, 0.140, 125}, {0.94, 0.110, 102}};
const std::vector<Lch> diverging_points = {{0.46, 0.150, 258}, {0.61, 0.125, 254}, {0.80, 0.070, 250},
                                           {0.965, 0.0, 0},    {0.80, 0.070, 40},  {0.61, 0.125, 34},
                                           {0.46, 0.150, 27}};
const std::vector<Lch> categories_points = {{0.58, 0.120, 250}, {0.75, 0.130, 70},  {0.62, 0.120, 150},
                                            {0.60, 0.170, 25},  {0.80, 0.090, 215}, {0.52, 0.140, 310},
                                            {0.85, 0.130, 105}, {0.74, 0.110, 350}};

}  // namespace

float srgb_to_linear(float c) { return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f); }
float linear_to_srgb(float c) {
    return c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
}

double luminance(const Vec3f& srgb) {
    return 0.2126 * srgb_to_linear(srgb[0]) + 0.7152 * srgb_to_linear(srgb[1]) +
           0.0722 * srgb_to_linear(srgb[2]);
}

const std::vector<std::string>& Colormap::names() {
    static const std::vector<std::string> all = {"sequential", "diverging", "categorical"};
    return all;
}

Colormap::Colormap(const std::string& name) {
    if (name == "sequential") {
        kind_ = Kind::sequential;
        table_ = sample(sequential_points);
    } else if (name == "diverging") {
        kind_ = Kind::diverging;
        table_ = sample(diverging_points);
    } else if (name == "categorical") {
        kind_ = Kind::categorical;
        for (const Lch& c : categories_points) table_.push_back(to_srgb(to_lab(c)));
    } else {
        throw InvalidInput(fmt::format("colour map '{}' is not one of {}", name, fmt::join(names(), ", ")));
    }
}

Vec3f Colormap::colour(double t) const {
    if (std::isnan(t)) return Vec3f::Constant(0.6f);
    const double inside = std::clamp(t, 0.0, 1.0);
    if (kind_ == Kind::categorical)
        return category(
            std::min<std::int64_t>(static_cast<std::int64_t>(inside * categories()), categories() - 1));
    const double x = inside * static_cast<double>(table_.size() - 1);
    const std::size_t i = std::min(static_cast<std::size_t>(x), table_.size() - 2);
    const float f = static_cast<float>(x - static_cast<double>(i));
    return table_[i] * (1 - f) + table_[i + 1] * f;
}

Vec3f Colormap::category(std::int64_t number) const {
    const auto n = static_cast<std::int64_t>(table_.size());
    return table_[static_cast<std::size_t>((number % n + n) % n)];
}

}  // namespace vdbgeo
