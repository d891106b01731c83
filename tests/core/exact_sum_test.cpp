// Sums that do not depend on the order, and are rounded once.
#include "vdbgeo/core/exact_sum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/thread_team.h"

namespace vdbgeo {
namespace {

double sum_of(const std::vector<double>& numbers) {
    ExactSum sum;
    for (const double x : numbers) sum.add(x);
    return sum.value();
}

/// Numbers of both signs and of very different sizes.
std::vector<double> some_numbers(int n) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> mantissa(-1, 1);
    std::uniform_int_distribution<int> exponent(-300, 300);
    std::vector<double> out;
    for (int i = 0; i < n; ++i) out.push_back(std::ldexp(mantissa(random), exponent(random)));
    return out;
}

TEST(ExactSum, IsRoundedOnce) {
    EXPECT_EQ(sum_of({}), 0);
    EXPECT_EQ(sum_of(std::vector<double>(10, 0.1)), 1.0);
    EXPECT_EQ(sum_of({1e300, 1, -1e300}), 1);
    EXPECT_EQ(sum_of({-1e300, -1, 1e300}), -1);
    EXPECT_EQ(sum_of({1e-320, 1e300, -1e300, 2e-320}), 1e-320 + 2e-320);
    EXPECT_EQ(sum_of({-0.0, 5e-324}), 5e-324);
    const double most = std::numeric_limits<double>::max();
    EXPECT_EQ(sum_of({most, most, -most}), most);
    EXPECT_EQ(sum_of({most, most}), std::numeric_limits<double>::infinity());
    // Half of the last bit goes to even, a little more goes up.
    const double bit = std::ldexp(1, -53);
    EXPECT_EQ(sum_of({1, bit}), 1);
    EXPECT_EQ(sum_of({1, bit, 1e-300}), 1 + 2 * bit);
    EXPECT_EQ(sum_of({1 + 2 * bit, bit}), 1 + 4 * bit);
    EXPECT_EQ(sum_of({-1, -bit, -1e-300}), -1 - 2 * bit);
}

TEST(ExactSum, HasTheSameBitsInAnyOrder) {
    std::vector<double> numbers = some_numbers(2000);
    const double expected = sum_of(numbers);
    EXPECT_NE(expected, 0);
    std::mt19937 random(3);
    for (int i = 0; i < 20; ++i) {
        std::shuffle(numbers.begin(), numbers.end(), random);
        EXPECT_EQ(sum_of(numbers), expected);
        ExactSum all, part;
        for (std::size_t k = 0; k < numbers.size(); ++k) {
            part.add(numbers[k]);
            if (random() % 7 != 0) continue;
            all.add(part);
            part = ExactSum();
        }
        all.add(part);
        EXPECT_EQ(all.value(), expected);
    }
    for (const double x : std::vector<double>(numbers)) numbers.push_back(-x);
    EXPECT_EQ(sum_of(numbers), 0);
}

TEST(ExactSum, OfATeam) {
    const std::vector<double> numbers = some_numbers(300);
    test::ThreadTeam(5).run([&](Team& team) {
        ExactSum sum;
        for (std::size_t i = static_cast<std::size_t>(team.rank()); i < numbers.size(); i += 5)
            sum.add(numbers[i]);
        sum.add_up(team);
        EXPECT_EQ(sum.value(), sum_of(numbers));
        sum.add(1e290);
        EXPECT_GT(sum.value(), 1e289);
    });
}

TEST(ExactSum, OfWhatIsNoNumberIsNone) {
    EXPECT_TRUE(std::isnan(sum_of({1, std::numeric_limits<double>::infinity()})));
    EXPECT_TRUE(std::isnan(sum_of({std::nan(""), 2})));
}

}  // namespace
}  // namespace vdbgeo
