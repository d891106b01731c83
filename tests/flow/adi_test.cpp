// The semi-implicit stepper of hyperdiffuse: u += Π_a (I + θτA_a)^{-1} τ A u.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/cosine_modes.h"
#include "tests/support/line_oracle.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using test::Oracle;
using test::State;
using test::Values;
using Kind = EdgeScale::Kind;

const EdgeScale no_edges{Kind::infinite, 2, 0, 1};

/// θ, as the stepper documents it.
double theta_of(int highest_order) { return std::max(1.0, 0.5 * std::pow(3.0, highest_order)); }

HyperdiffusionOptions adi_options(int order, double diffusivity = 1) {
    HyperdiffusionOptions o;
    o.terms = {{order, diffusivity}};
    o.sigma = no_edges;
    o.stepper = Stepper::adi;
    return o;
}

double bound_of(const HyperdiffusionOptions& o) { return 2 / o.largest_rate(Vec3d::Ones()); }

double mean_of(const openvdb::FloatGrid& grid) {
    double sum = 0;
    for (auto it = grid.cbeginValueOn(); it; ++it) sum += *it;
    return sum / static_cast<double>(grid.activeVoxelCount());
}

double variance_of(const openvdb::FloatGrid& grid) {
    const double mean = mean_of(grid);
    double sum = 0;
    for (auto it = grid.cbeginValueOn(); it; ++it) sum += (*it - mean) * (*it - mean);
    return sum / static_cast<double>(grid.activeVoxelCount());
}

/// The amplitude of a mode after the steps.
double amplitude(const test::CosineMode& m, const HyperdiffusionOptions& o) {
    double implicit = 1 + theta_of(o.terms[0].order) * *o.dt * o.fidelity, whole = 0;
    for (int a = 0; a < 3; ++a) {
        const double along = 2 * (1 - std::cos(M_PI * m.k[a] / m.n[a]));
        implicit *= 1 + theta_of(o.terms[0].order) * *o.dt * o.terms[0].diffusivity *
                            std::pow(along, o.terms[0].order + 1);
        whole += along;
    }
    const double rate = o.terms[0].diffusivity * std::pow(whole, o.terms[0].order + 1);
    double out = 1;
    for (int k = 0; k < *o.steps; ++k) out += *o.dt * (o.fidelity * (1 - out) - rate * out) / implicit;
    return out;
}

class AdiOf : public testing::TestWithParam<int> {};

TEST_P(AdiOf, CosineModesHasTheAmplitudesOfItsFormula) {
    const test::CosineBox box = test::cosine_box();
    for (const double share : {0.3, 3.0, 20.0})
        for (const double fidelity : {0.0, 0.4}) {
            HyperdiffusionOptions o = adi_options(GetParam(), 0.7);
            o.fidelity = fidelity;
            o.steps = 6;
            o.dt = share * bound_of(o);
            const auto grid = box.grid();
            const HyperdiffusionReport report = hyperdiffuse(*grid, o);
            EXPECT_EQ(report.steps, 6);
            EXPECT_NEAR(report.time, 6 * *o.dt, 1e-12 * report.time);
            std::vector<double> amplitudes;
            for (const test::CosineMode& m : box.modes) amplitudes.push_back(amplitude(m, o));
            // A step's explicit part is `share` times the values, and rounds as they do.
            EXPECT_LT(box.difference(*grid, amplitudes), 2e-6 * (3 + share)) << share << ", " << fidelity;
        }
}

/// Takes the steps on noise: it is smoothed, and its mean is kept.
void expect_smoothing(openvdb::FloatGrid& grid, const HyperdiffusionOptions& o) {
    const double mean = mean_of(grid), variance = variance_of(grid);
    const HyperdiffusionReport report = hyperdiffuse(grid, o);
    EXPECT_LT(variance_of(grid), variance);
    EXPECT_NEAR(mean_of(grid), mean, 1e-4);
    EXPECT_NEAR(report.mean_after, mean_of(grid), 1e-6);
}

TEST_P(AdiOf, NoiseInABoxIsStableFarAboveTheExplicitBound) {
    test::SparseMaker make(21);
    const auto grid = test::box_grid(test::box_of(Coord(-5, 3, 60), 14, 17, 12),
                                     [&](const Coord&) { return 2 * make.uniform() - 1; });
    HyperdiffusionOptions o = adi_options(GetParam());
    o.steps = 40;
    o.dt = 20 * bound_of(o);
    expect_smoothing(*grid, o);
}

/// Where the operators of the axes do not commute: with the step it takes by itself.
TEST_P(AdiOf, NoiseOnAnyMaskIsStableWithTheStepOfItsOwn) {
    for (const std::string kind : {"leaf corner", "few leaves", "shell"})
        for (const Kind sigma : {Kind::infinite, Kind::local}) {
            SCOPED_TRACE(kind + (sigma == Kind::local ? ", edges kept" : ""));
            const auto grid = test::sparse_grid(kind, 21);
            HyperdiffusionOptions o = adi_options(GetParam());
            o.sigma.kind = sigma;
            o.steps = 40;
            expect_smoothing(*grid, o);
        }
}

TEST_P(AdiOf, SmallStepsGoToEulersSolutionInFirstOrder) {
    const test::CosineBox box = test::cosine_box();
    HyperdiffusionOptions o = adi_options(GetParam());
    o.sigma = {Kind::value, 2, 0.5, 1};
    o.time = 4 * bound_of(o);
    HyperdiffusionOptions fine = o;
    fine.stepper = Stepper::euler;
    fine.dt = *o.time / 1000;
    const auto exact = box.grid();
    hyperdiffuse(*exact, fine);
    std::vector<double> errors;
    for (const int n : {40, 80, 160}) {
        const auto grid = box.grid();
        o.dt = *o.time / n;
        EXPECT_EQ(hyperdiffuse(*grid, o).steps, n);
        double most = 0;
        for (auto it = grid->cbeginValueOn(); it; ++it)
            most = std::max(most, double(std::abs(*it - exact->tree().getValue(it.getCoord()))));
        errors.push_back(most);
    }
    EXPECT_NEAR(errors[0] / errors[1], 2, 0.35);
    EXPECT_NEAR(errors[1] / errors[2], 2, 0.35);
}

INSTANTIATE_TEST_SUITE_P(Orders, AdiOf, testing::Values(0, 1, 2));

/// Every mask, edges, a sum of orders and fidelity, against dense solves.
TEST(Adi, AgreesWithTheTwinOnEveryMask) {
    for (const std::string& kind : test::sparse_kinds())
        for (const std::vector<DiffusionTerm>& terms :
             {std::vector<DiffusionTerm>{{0, 1.0}}, std::vector<DiffusionTerm>{{1, 0.8}},
              std::vector<DiffusionTerm>{{0, 0.3}, {2, 0.02}}}) {
            SCOPED_TRACE(kind + ", order " + std::to_string(terms.back().order));
            const auto grid = test::sparse_grid(kind, 22);
            HyperdiffusionOptions o = adi_options(0);
            o.terms = terms;
            o.sigma = {Kind::value, 2, 0.6, 1};
            o.fidelity = 0.3;
            o.steps = 3;
            o.dt = 5 * bound_of(o);
            const Oracle oracle(*grid);
            const double theta = theta_of(terms.back().order);
            State s{oracle.input()};
            for (int k = 0; k < *o.steps; ++k) {
                const State rate = oracle.hyperdiffusion(terms, o.sigma, o.fidelity, s)(s);
                std::vector<test::LineTerm> lines;
                for (const DiffusionTerm& t : terms)
                    lines.push_back({t.order, 1, oracle.diffusivity(s[0], t, o.sigma)});
                Oracle::add(s[0], *o.dt / (1 + theta * *o.dt * o.fidelity),
                            test::solve_lines(oracle, lines, Vec3d::Ones(), theta * *o.dt, rate[0]));
            }
            hyperdiffuse(*grid, o);
            double most = 0;
            for (std::size_t i = 0; i < oracle.size(); ++i)
                most = std::max(most, std::abs(grid->tree().getValue(oracle.voxel(i)) - s[0][i]));
            EXPECT_LT(most, 2e-5);
        }
}

TEST(Adi, GivesTheSameBitsForAnyNumberOfThreads) {
    const auto input = test::sparse_grid("cells", 23);
    for (const int q : {0, 1, 2}) {
        HyperdiffusionOptions o = adi_options(q);
        o.sigma.kind = Kind::local;
        o.steps = 3;
        std::vector<std::uint32_t> first;
        for (const std::size_t threads : {1, 2, 4})
            test::with_threads(threads, [&] {
                const auto grid = input->deepCopy();
                hyperdiffuse(*grid, o);
                if (threads == 1) first = test::bits_of(*grid);
                EXPECT_EQ(test::bits_of(*grid), first);
            });
        const auto grid = input->deepCopy();
        hyperdiffuse(*grid, o);
        EXPECT_TRUE(test::inactive_untouched(*grid));
    }
}

TEST(Adi, TakesTwentyTimesTheExplicitStepByItself) {
    const auto grid = test::sparse_grid("few leaves", 24);
    HyperdiffusionOptions o = adi_options(1);
    o.steps = 2;
    EXPECT_NEAR(hyperdiffuse(*grid, o).dt, 18 * bound_of(o), 1e-9);
    o.steps.reset();
    EXPECT_THROW(hyperdiffuse(*grid, o), InvalidInput);  // an automatic time is fsi's
}

}  // namespace
}  // namespace vdbgeo
