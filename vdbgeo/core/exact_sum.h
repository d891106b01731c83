// Sums of floating-point numbers that do not depend on the order.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "vdbgeo/core/team.h"

namespace vdbgeo {

/// A sum of doubles without any rounding until it is read, in one fixed-point number as long as the range of
/// a double (Kulisch 2013, "Computer Arithmetic and Validity", ch. 8): the same bits whatever the order of
/// the additions, and whoever made which of them. 2^31 members of a team may add up theirs.
///
/// Cost: some 5 ns a number, 560 bytes.
class ExactSum {
 public:
    void add(double x);
    void add(const ExactSum& other);
    /// Adds up what all members have; all have it then.
    void add_up(Team& team);
    /// Rounded to nearest; NaN where a number was not finite.
    double value() const;

 private:
    /// The digits to base 2^32 of the sum in units of 2^−1074, the lowest first. Each takes 2^30 numbers
    /// before it has to give its carry away.
    static constexpr std::size_t digits = 68;
    void carry();

    std::array<std::int64_t, digits> digit_{};
    std::uint64_t not_finite_ = 0;
    std::uint32_t since_carry_ = 0;
};

}  // namespace vdbgeo
