#include "vdbgeo/view/ticks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace vdbgeo {
namespace {

double round_up(double limit) {
    const double power = std::pow(10.0, std::floor(std::log10(limit)));
    for (const double digit : {1.0, 2.0, 5.0})
        if (digit * power >= limit * (1 - 1e-9)) return digit * power;
    return 10 * power;
}

std::string with_minus(std::string text) {
    if (!text.empty() && text[0] == '-') text.replace(0, 1, "\u2212");
    return text;
}

std::string raised(int exponent) {
    static const char* const digits[] = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                         "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
    std::string result = exponent < 0 ? "\u207b" : "";
    for (const char c : std::to_string(std::abs(exponent))) result += digits[c - '0'];
    return result;
}

/// `value` to the precision of `step`; in powers of ten where the plain number would be unwieldy.
std::string label(double value, double step, double largest) {
    if (value == 0) return "0";
    const int top = static_cast<int>(std::floor(std::log10(largest) + 1e-9));
    const int bottom = static_cast<int>(std::floor(std::log10(step) + 1e-9));
    if (top > 5 || bottom < -4) {
        const int decimals = std::clamp(top - bottom, 0, 12);
        return with_minus(
            fmt::format("{:.{}f}\u00d710{}", value / std::pow(10.0, top), decimals, raised(top)));
    }
    return with_minus(fmt::format("{:.{}f}", value, std::max(0, -bottom)));
}

}  // namespace

double round_down(double limit) {
    const double power = std::pow(10.0, std::floor(std::log10(limit)));
    for (const double digit : {10.0, 5.0, 2.0})  // 10: the logarithm may have been rounded down
        if (digit * power <= limit * (1 + 1e-9)) return digit * power;
    return power;
}

std::string power_of_ten(int exponent) {
    return exponent == 0 ? "1" : exponent == 1 ? "10" : "10" + raised(exponent);
}

Ticks make_ticks(double low, double high, int most) {
    Ticks ticks;
    if (!(high > low)) return {{low}, {with_minus(fmt::format("{:.6g}", low))}};
    const double step = round_up((high - low) / std::max(1, most - 1));
    const double largest = std::max(std::abs(low), std::abs(high));
    const double slack = 1e-6 * step;
    for (double k = std::ceil((low - slack) / step); k * step <= high + slack; k += 1) {
        ticks.values.push_back(k * step);
        ticks.labels.push_back(label(k * step, step, largest));
    }
    return ticks;
}

}  // namespace vdbgeo
