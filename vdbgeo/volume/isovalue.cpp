#include "vdbgeo/volume/isovalue.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

Isovalue Isovalue::parse(const std::string& text) {
    if (text == "auto") return {};
    const char* const end = text.data() + text.size();
    double number = 0;
    const auto [rest, error] = std::from_chars(text.data(), end, number);
    const std::string unit(rest, static_cast<std::size_t>(end - rest));
    if (error == std::errc() && std::isfinite(number)) {
        if (unit.empty()) return {Rule::value, number};
        if (unit == "sigma") return {Rule::sigma, number};
    }
    throw InvalidInput(fmt::format(
        "'{}' is not an isovalue: give a number, a number of sigmas such as 3sigma, or auto", text));
}

std::string Isovalue::text() const {
    if (rule == Rule::automatic) return "auto";
    return fmt::format("{}{}", number, rule == Rule::sigma ? "sigma" : "");
}

double Isovalue::resolve(const Statistics& s, openvdb::GridClass grid_class) const {
    if (rule == Rule::value) return number;
    if (rule == Rule::automatic && grid_class == openvdb::GRID_LEVEL_SET) return 0;
    if (s.count == s.non_finite) throw InvalidInput("the map has no finite sample to take an isovalue from");
    if (rule == Rule::automatic && grid_class == openvdb::GRID_FOG_VOLUME) return 0.5 * s.max;
    return s.mean + (rule == Rule::sigma ? number : 3) * s.rms;
}

}  // namespace vdbgeo
