// Colour maps: from a number to a colour, in steps that the eye sees as even.
#pragma once

#include <string>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// A colour map. The control points are our own, given by lightness, chroma and hue in the OKLab space
/// (B. Ottosson 2020, "A perceptual color space for image processing") and joined by smooth curves there:
///   sequential   dark blue over green to pale yellow; luminance rises all the way
///   diverging    blue over white to red; both halves equally dark at equal distance from the middle
///   categorical  eight well separated colours for class numbers
class Colormap {
 public:
    /// InvalidInput for another name than those of `names()`.
    explicit Colormap(const std::string& name);

    static const std::vector<std::string>& names();

    /// sRGB at t in 0…1; what lies outside is clamped, NaN gives a middle grey. A categorical map divides 0…1
    /// into equal parts, one colour each.
    Vec3f colour(double t) const;

    /// Number of colours of a categorical map, 0 for the others.
    int categories() const { return kind_ == Kind::categorical ? static_cast<int>(table_.size()) : 0; }
    /// Colour of class `number`, counted from 0; larger and negative numbers wrap round.
    Vec3f category(std::int64_t number) const;

    bool diverging() const { return kind_ == Kind::diverging; }

 private:
    enum class Kind { sequential, diverging, categorical };
    Kind kind_;
    std::vector<Vec3f> table_;  // sRGB at even steps
};

/// One channel from sRGB to linear light and back (IEC 61966-2-1).
float srgb_to_linear(float channel);
float linear_to_srgb(float channel);

/// Relative luminance Y of an sRGB colour, 0…1.
double luminance(const Vec3f& srgb);

}  // namespace vdbgeo
