// Round numbers for axes and scale bars.
#pragma once

#include <string>
#include <vector>

namespace vdbgeo {

/// The largest of 1, 2, 5 × 10^k that is not above `limit` (> 0).
double round_down(double limit);

/// "10⁻⁵"; 1 and 10 as they are.
std::string power_of_ten(int exponent);

/// Round values inside [low, high], at most `most` (≥ 2) of them, evenly spaced by 1, 2 or 5 × 10^k.
struct Ticks {
    std::vector<double> values;
    std::vector<std::string> labels;  ///< equally precise; a true minus sign; powers of ten as 2×10⁻⁵
};
Ticks make_ticks(double low, double high, int most);

}  // namespace vdbgeo
