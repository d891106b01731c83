#include "vdbgeo/core/exact_sum.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace vdbgeo {
namespace {

__extension__ using Wide = unsigned __int128;

constexpr std::uint32_t room = std::uint32_t(1) << 30;
constexpr int lowest_exponent = -1074;

}  // namespace

void ExactSum::add(double x) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof bits);
    const auto exponent = static_cast<unsigned>(bits >> 52 & 0x7ff);
    std::uint64_t mantissa = bits & ((std::uint64_t(1) << 52) - 1);
    if (exponent == 0x7ff) {
        ++not_finite_;
        return;
    }
    if (exponent > 0) mantissa |= std::uint64_t(1) << 52;
    const unsigned shift = exponent > 0 ? exponent - 1 : 0;  // of the mantissa, in units
    const Wide value = static_cast<Wide>(mantissa) << (shift % 32);
    const std::int64_t sign = bits >> 63 ? -1 : 1;
    std::int64_t* const to = digit_.data() + shift / 32;
    for (int i = 0; i < 3; ++i) to[i] += sign * static_cast<std::int64_t>(value >> (32 * i) & 0xffffffff);
    if (++since_carry_ == room) carry();
}

void ExactSum::add(const ExactSum& other) {
    ExactSum more = other;
    more.carry();
    for (std::size_t i = 0; i < digits; ++i) digit_[i] += more.digit_[i];
    not_finite_ += more.not_finite_;
    if (++since_carry_ == room) carry();
}

/// All digits but the last, which has the sign, come to lie in [0, 2^32): there is one such form of a number.
void ExactSum::carry() {
    for (std::size_t i = 0; i + 1 < digits; ++i) {
        const std::int64_t up = digit_[i] >> 32;  // rounds to minus infinity
        digit_[i] -= up * (std::int64_t(1) << 32);
        digit_[i + 1] += up;
    }
    since_carry_ = 0;
}

void ExactSum::add_up(Team& team) {
    carry();
    std::vector<std::uint64_t> numbers{not_finite_};
    for (const std::int64_t d : digit_) numbers.push_back(static_cast<std::uint64_t>(d));
    team.add_up(numbers);
    not_finite_ = numbers[0];
    for (std::size_t i = 0; i < digits; ++i) digit_[i] = static_cast<std::int64_t>(numbers[i + 1]);
    carry();
}

double ExactSum::value() const {
    if (not_finite_ > 0) return std::numeric_limits<double>::quiet_NaN();
    ExactSum s = *this;
    s.carry();
    const bool negative = s.digit_.back() < 0;
    if (negative) {
        for (std::int64_t& d : s.digit_) d = -d;
        s.carry();
    }
    std::size_t top = digits;
    while (top > 0 && s.digit_[top - 1] == 0) --top;
    // Three digits hold more bits than a double; of what is below them the lowest bit tells whether there is
    // any.
    Wide value = 0;
    bool rest = false;
    for (std::size_t i = 0; i < top; ++i) {
        const auto digit = static_cast<std::uint64_t>(s.digit_[i]);
        if (i + 3 >= top)
            value |= static_cast<Wide>(digit) << (32 * (i + 3 - top));
        else
            rest = rest || digit != 0;
    }
    if (rest) value |= 1;
    const double size =
        std::ldexp(static_cast<double>(value), 32 * (static_cast<int>(top) - 3) + lowest_exponent);
    return negative ? -size : size;
}

}  // namespace vdbgeo
