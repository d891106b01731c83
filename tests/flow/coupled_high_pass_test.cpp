#include "vdbgeo/flow/coupled_high_pass.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/cosine_modes.h"
#include "tests/support/dense_oracle.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using test::Oracle;
using test::State;
using test::Values;
using Kind = EdgeScale::Kind;

const EdgeScale no_edges{Kind::infinite, 2, 0, 1};

double bound_of(const HighPassOptions& o) {
    return 2 / (o.fast * std::pow(12.0, o.order + 1) + o.coupling_u + o.coupling_v);
}

State step(const HighPassOptions& o, const HyperdiffusionReport& report, State s,
           const std::function<test::Rate(const State&)>& freeze) {
    const int n = report.steps / std::max(report.cycles, 1);
    for (int c = 0; c < report.cycles; ++c) {
        const test::Rate rate = freeze(s);
        s = o.stepper == Stepper::fsi ? test::fsi_cycle(s, n, report.dt, rate)
                                      : test::euler_step(s, report.dt, rate);
    }
    return s;
}

Values difference(const State& s) {
    Values w = s[0];
    Oracle::add(w, -1, s[1]);
    return w;
}

std::vector<HighPassOptions> cases() {
    std::vector<HighPassOptions> out;
    for (const Stepper stepper : {Stepper::fsi, Stepper::euler})
        for (const int q : {0, 1, 2})
            for (const EdgeScale& sigma : {EdgeScale{}, EdgeScale{Kind::global, 2, 0, 1}, no_edges}) {
                HighPassOptions o;
                o.order = q;
                o.sigma = sigma;
                o.stepper = stepper;
                o.slow = q == 1 ? 0.1 : 0;
                o.coupling_u = 0.3;
                o.coupling_v = q == 2 ? 0.05 : 0.3;
                o.cycle = 6;
                o.time = (stepper == Stepper::fsi ? 25 : 5) * bound_of(o);
                out.push_back(o);
            }
    return out;
}

class HighPassOn : public testing::TestWithParam<std::string> {};

TEST_P(HighPassOn, AgreesWithTheOracle) {
    const auto input = test::sparse_grid(GetParam(), 41);
    for (const HighPassOptions& o : cases()) {
        const auto grid = input->deepCopy();
        const Oracle oracle(*grid);
        const HyperdiffusionReport report = coupled_high_pass(*grid, o);
        const State end = step(o, report, {oracle.input(), oracle.input()}, [&](const State& s) {
            return oracle.coupled(o.order, {o.slow, o.fast}, {o.coupling_u, o.coupling_v}, o.sigma, s);
        });
        EXPECT_LT(test::largest_difference(*grid, oracle, difference(end)),
                  1e-5 * std::max(oracle.range(), 0.1))
            << "order " << o.order << ", sigma " << o.sigma.text();
        EXPECT_TRUE(test::inactive_untouched(*grid));
        EXPECT_NEAR(report.time, o.time, 1e-9 * o.time);
    }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, HighPassOn, testing::ValuesIn(test::sparse_kinds()), name_of);

/// Each cosine mode follows a system of two linear equations.
TEST(HighPass, CosineModesFollowTheirDiscreteSystem) {
    const test::CosineBox box = test::cosine_box();
    for (HighPassOptions o : cases()) {
        if (o.sigma.kind != Kind::infinite) continue;
        const auto grid = box.grid();
        const HyperdiffusionReport report = coupled_high_pass(*grid, o);
        std::vector<double> amplitudes;
        for (const test::CosineMode& m : box.modes) {
            const double l = std::pow(m.eigenvalue(), o.order + 1);
            const test::Rate rate = [&](const State& s) {
                const double u = s[0][0], v = s[1][0];
                return State{{-o.slow * l * u + o.coupling_u * (v - u)},
                             {-o.fast * l * v + o.coupling_v * (u - v)}};
            };
            const State end = step(o, report, {{1.0}, {1.0}}, [&](const State&) { return rate; });
            amplitudes.push_back(end[0][0] - end[1][0]);
        }
        EXPECT_LT(box.difference(*grid, amplitudes), 1e-5) << "order " << o.order;
    }
}

/// exp(m) by its series, after halving.
Eigen::Matrix2d exponential(const Eigen::Matrix2d& m) {
    constexpr int halvings = 20;
    const Eigen::Matrix2d small = m / std::pow(2.0, halvings);
    Eigen::Matrix2d out = Eigen::Matrix2d::Identity() + small + small * small / 2 + small * small * small / 6;
    for (int i = 0; i < halvings; ++i) out = (out * out).eval();
    return out;
}

TEST(HighPass, CosineModesComeToTheMatrixExponential) {
    const test::CosineBox box = test::cosine_box();
    HighPassOptions o;
    o.sigma = no_edges;
    o.slow = 0.05;
    o.coupling_u = 0.8;
    o.coupling_v = 0.4;
    o.time = 1.5;
    o.stepper = Stepper::euler;
    o.dt = 0.0005;
    const auto grid = box.grid();
    coupled_high_pass(*grid, o);
    std::vector<double> amplitudes;
    for (const test::CosineMode& m : box.modes) {
        const double l = m.eigenvalue();
        Eigen::Matrix2d a;
        a << -o.slow * l - o.coupling_u, o.coupling_u, o.coupling_v, -o.fast * l - o.coupling_v;
        const Eigen::Vector2d end = exponential(a * o.time) * Eigen::Vector2d(1, 1);
        amplitudes.push_back(end[0] - end[1]);
    }
    EXPECT_LT(box.difference(*grid, amplitudes), 1e-3);
}

TEST(HighPass, OfEqualDiffusionsAndOfConstantsIsZero) {
    for (HighPassOptions o : cases()) {
        const auto grid = test::sparse_grid("few leaves", 3);
        o.slow = o.fast;
        o.coupling_v = o.coupling_u;
        coupled_high_pass(*grid, o);
        for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 0.0f);
        o.slow = 0;
        for (auto it = grid->beginValueOn(); it; ++it) it.setValue(17.3f);
        coupled_high_pass(*grid, o);
        for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 0.0f);
    }
}

TEST(HighPass, StrongCouplingSynchronises) {
    double before = std::numeric_limits<double>::infinity();
    for (const double coupling : {0.01, 1.0, 100.0, 10000.0}) {
        const auto grid = test::sparse_grid("inside a leaf", 4);
        HighPassOptions o;
        o.coupling_u = o.coupling_v = coupling;
        o.time = 1;
        coupled_high_pass(*grid, o);
        double most = 0;
        for (auto it = grid->cbeginValueOn(); it; ++it) most = std::max<double>(most, std::abs(*it));
        EXPECT_LT(most, before);
        before = most;
    }
    EXPECT_LT(before, 1e-3);
}

TEST(HighPass, WithoutCouplingIsTheLowPassTakenAway) {
    const auto input = test::sparse_grid("cells", 5), grid = input->deepCopy(), low = input->deepCopy();
    HighPassOptions o;
    o.coupling_u = o.coupling_v = 0;
    o.time = 3;
    coupled_high_pass(*grid, o);
    HyperdiffusionOptions same;
    same.terms = {{o.order, o.fast}};
    same.sigma = o.sigma;
    same.time = 3;
    hyperdiffuse(*low, same);
    for (auto it = input->cbeginValueOn(); it; ++it)
        ASSERT_NEAR(grid->tree().getValue(it.getCoord()), *it - low->tree().getValue(it.getCoord()), 2e-6);
}

TEST(HighPass, OfNoTimeIsZeroAndOfNothingNothing) {
    HighPassOptions o;
    o.time = 0;
    const auto grid = test::sparse_grid("cells", 6), nothing = test::empty_grid();
    coupled_high_pass(*grid, o);
    for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 0.0f);
    EXPECT_EQ(coupled_high_pass(*nothing, {}).active_voxels, 0u);
}

TEST(HighPass, WithoutAnyRateIsZero) {
    HighPassOptions o;
    o.slow = o.fast = o.coupling_u = o.coupling_v = 0;
    const auto grid = test::sparse_grid("cells", 6);
    coupled_high_pass(*grid, o);
    for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 0.0f);
}

TEST(HighPass, GivesTheSameBitsForAnyNumberOfThreads) {
    std::vector<std::uint32_t> first;
    for (const std::size_t threads : {1, 2, 4})
        test::with_threads(threads, [&] {
            const auto grid = test::sparse_grid("shell", 7);
            coupled_high_pass(*grid, {});
            if (threads == 1) first = test::bits_of(*grid);
            EXPECT_EQ(test::bits_of(*grid), first);
        });
}

TEST(HighPass, RefusesBadInputAndTouchesNothing) {
    const auto grid = test::sparse_grid("few leaves", 8);
    const auto before = test::bits_of(*grid);
    const double nan = std::nan("");
    const auto refused = [&](const std::function<void(HighPassOptions&)>& change) {
        HighPassOptions o;
        change(o);
        EXPECT_THROW(coupled_high_pass(*grid, o), InvalidInput);
    };
    using O = HighPassOptions;
    for (const int q : {-1, 16}) refused([q](O& o) { o.order = q; });
    for (const double d : {-0.1, 1.1, nan}) refused([d](O& o) { o.slow = d; });
    for (const double c : {-1.0, nan}) {
        refused([c](O& o) { o.fast = c; });
        refused([c](O& o) { o.coupling_u = c; });
        refused([c](O& o) { o.coupling_v = c; });
        refused([c](O& o) { o.time = c; });
        refused([c](O& o) { o.dt = c; });
        refused([c](O& o) { o.sigma = {Kind::value, 2, c, 1}; });
        refused([c](O& o) { o.sigma.factor = c; });
    }
    refused([](O& o) { o.sigma.radius = 9; });
    refused([](O& o) { o.cycle = 0; });
    refused([](O& o) { o.dt = 1.001 * bound_of(o); });
    EXPECT_EQ(test::bits_of(*grid), before);
    grid->tree().setValueOn(grid->cbeginValueOn().getCoord(), std::numeric_limits<float>::quiet_NaN());
    EXPECT_THROW(coupled_high_pass(*grid, {}), InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
