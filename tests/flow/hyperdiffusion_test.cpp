#include "vdbgeo/flow/hyperdiffusion.h"

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

constexpr double infinity = std::numeric_limits<double>::infinity();
const EdgeScale no_edges{Kind::infinite, 2, 0, 1};

/// Values in [low, high) instead of [−1, 1).
openvdb::FloatGrid::Ptr rescaled(const openvdb::FloatGrid::Ptr& grid, double low, double high) {
    for (auto it = grid->beginValueOn(); it; ++it)
        it.setValue(static_cast<float>(low + (*it + 1) / 2 * (high - low)));
    return grid;
}

/// What the twin makes of the grid by the cycles that the report tells of.
Values twin(const Oracle& oracle, const HyperdiffusionOptions& o, const HyperdiffusionReport& report) {
    State s{oracle.input()};
    const int n = report.steps / std::max(report.cycles, 1);
    for (int c = 0; c < report.cycles; ++c) {
        const test::Rate rate = oracle.hyperdiffusion(o.terms, o.sigma, o.fidelity, s);
        if (o.stepper == Stepper::fsi)
            s = test::fsi_cycle(s, n, report.dt, rate);
        else
            s = test::euler_step(s, report.dt, rate);
    }
    return s[0];
}

// ------------------------------------------------------------------------------------------- exact decay

class DecayOf : public testing::TestWithParam<int> {};

TEST_P(DecayOf, CosineModesIsExactWithEuler) {
    const test::CosineBox box = test::cosine_box();
    const int q = GetParam();
    for (const double share : {1.0, 0.45}) {
        HyperdiffusionOptions o;
        o.terms = {{q, 0.7}};
        o.sigma = no_edges;
        o.stepper = Stepper::euler;
        o.steps = 37;
        o.dt = share * 2 / o.largest_rate(Vec3d::Ones());
        const auto grid = box.grid();
        const HyperdiffusionReport report = hyperdiffuse(*grid, o);
        EXPECT_EQ(report.steps, 37);
        EXPECT_DOUBLE_EQ(report.dt, *o.dt);
        EXPECT_NEAR(report.time, 37 * *o.dt, 1e-12 * report.time);
        std::vector<double> amplitudes;
        for (const test::CosineMode& m : box.modes)
            amplitudes.push_back(std::pow(1 - *o.dt * 0.7 * std::pow(m.eigenvalue(), q + 1), 37));
        EXPECT_LT(box.difference(*grid, amplitudes), 1e-5);
    }
}

TEST_P(DecayOf, CosineModesIsExactWithFsi) {
    const test::CosineBox box = test::cosine_box();
    const int q = GetParam();
    for (const int cycle : {1, 2, 7, 20}) {
        HyperdiffusionOptions o;
        o.terms = {{q, 1.3}};
        o.sigma = no_edges;
        o.steps = 3 * cycle;
        o.cycle = cycle;
        const auto grid = box.grid();
        const HyperdiffusionReport report = hyperdiffuse(*grid, o);
        EXPECT_EQ(report.steps, 3 * cycle);
        EXPECT_EQ(report.cycles, 3);
        EXPECT_NEAR(report.time, 3 * report.dt * cycle * (cycle + 1) / 3, 1e-12 * report.time);
        std::vector<double> amplitudes;
        for (const test::CosineMode& m : box.modes) {
            const double rate = 1.3 * std::pow(m.eigenvalue(), q + 1);
            State s{{1.0}};
            for (int c = 0; c < 3; ++c)
                s = test::fsi_cycle(s, cycle, report.dt,
                                    [&](const State& u) { return State{{-rate * u[0][0]}}; });
            amplitudes.push_back(s[0][0]);
        }
        EXPECT_LT(box.difference(*grid, amplitudes), 1e-5) << "cycle " << cycle;
    }
}

INSTANTIATE_TEST_SUITE_P(Orders, DecayOf, testing::Values(0, 1, 2, 3, 12));

TEST(Hyperdiffusion, CyclesComeToTheHeatEquation) {
    const test::CosineBox box = test::cosine_box();
    for (const int q : {0, 1, 2}) {
        HyperdiffusionOptions o;
        o.terms = {{q, 1.0}};
        o.sigma = no_edges;
        o.time = 0.5 / std::pow(box.modes[2].eigenvalue(), q + 1);
        o.min_cycles = 40;
        const auto grid = box.grid();
        const HyperdiffusionReport report = hyperdiffuse(*grid, o);
        EXPECT_NEAR(report.time, *o.time, 1e-9 * *o.time);
        std::vector<double> amplitudes;
        for (const test::CosineMode& m : box.modes)
            amplitudes.push_back(std::exp(-*o.time * std::pow(m.eigenvalue(), q + 1)));
        EXPECT_LT(box.difference(*grid, amplitudes), 0.01) << "order " << q;
    }
}

// --------------------------------------------------------------------------------------------- the twin

struct Named {
    std::string name;
    HyperdiffusionOptions options;
    Vec3d voxel = Vec3d::Ones();
};

std::vector<Named> option_cases() {
    std::vector<Named> out;
    const auto add = [&](const std::string& name, const std::vector<DiffusionTerm>& terms,
                         const EdgeScale& sigma, int cycles, const std::function<void(Named&)>& more = {}) {
        Named n{name, {}, Vec3d::Ones()};
        n.options.terms = terms;
        n.options.sigma = sigma;
        n.options.min_cycles = cycles;
        double rate = 0;
        for (const DiffusionTerm& t : terms) rate += t.diffusivity * std::pow(12.0, t.order + 1);
        n.options.time = 12 * cycles / rate;
        if (more) more(n);
        out.push_back(n);
    };
    for (int r = 1; r <= 3; ++r)
        for (int q = 0; q <= 2; ++q)
            add("local " + std::to_string(r) + " q" + std::to_string(q), {{q, 1.0}}, {Kind::local, r, 0, 1},
                2);
    for (int q = 0; q <= 3; ++q) {
        add("global q" + std::to_string(q), {{q, 0.6}}, {Kind::global, 2, 0, 1}, 2);
        add("value q" + std::to_string(q), {{q, 1.0}}, {Kind::value, 2, 0.3, 1}, 2);
        add("infinite q" + std::to_string(q), {{q, 1.0}}, no_edges, 2);
    }
    add("factor", {{0, 1.0}}, {Kind::local, 2, 0, 0.4}, 3);
    add("global, factor", {{1, 1.0}}, {Kind::global, 2, 0, 1.7}, 2);
    add("sum", {{0, 0.5}, {1, 0.1}}, {Kind::local, 2, 0, 1}, 2);
    add("sum, any order", {{2, 0.002}, {0, 0.3}, {1, 0.02}}, {Kind::local, 1, 0, 1}, 2);
    add("sum, infinite", {{0, 0.5}, {3, 0.001}}, no_edges, 2);
    add("fidelity", {{0, 1.0}}, {Kind::local, 2, 0, 1}, 3, [](Named& n) { n.options.fidelity = 2.5; });
    add("fidelity, sum", {{0, 1.0}, {1, 0.1}}, no_edges, 2, [](Named& n) { n.options.fidelity = 1; });
    add("long cycle", {{1, 1.0}}, {Kind::local, 2, 0, 1}, 1, [](Named& n) {
        n.options.time = 0.6;
        n.options.cycle = 30;
    });
    add("short cycles", {{0, 1.0}}, {Kind::local, 2, 0, 1}, 5, [](Named& n) { n.options.cycle = 2; });
    for (const int q : {0, 1})
        add("euler q" + std::to_string(q), {{q, 1.0}}, {Kind::local, 2, 0, 1}, 1, [](Named& n) {
            n.options.stepper = Stepper::euler;
            n.options.time.reset();
            n.options.steps = 6;
        });
    add("euler, dt", {{0, 1.0}, {2, 0.001}}, no_edges, 1, [](Named& n) {
        n.options.stepper = Stepper::euler;
        n.options.dt = 0.05;
        n.options.time = 0.7;
    });
    for (const int q : {0, 1, 2})
        for (const auto& [kind, value] :
             {std::pair(Kind::local, 0.0), {Kind::global, 0.0}, {Kind::value, 0.2}})
            add("flat voxels q" + std::to_string(q), {{q, 1.0}}, {kind, 1, value, 1}, 2,
                [](Named& n) { n.voxel = Vec3d(1.5, 1.0, 3.0); });
    return out;
}

class HyperdiffusionOn : public testing::TestWithParam<std::string> {};

TEST_P(HyperdiffusionOn, AgreesWithTheOracle) {
    const auto input = rescaled(test::sparse_grid(GetParam(), 31), 3, 7);
    for (const Named& c : option_cases()) {
        SCOPED_TRACE(c.name);
        const auto grid = input->deepCopy();
        openvdb::math::Mat4d scale = openvdb::math::Mat4d::identity();
        for (int a = 0; a < 3; ++a) scale(a, a) = c.voxel[a];
        grid->setTransform(openvdb::math::Transform::createLinearTransform(scale));
        const Vec3d least = Vec3d::Constant(c.voxel.minCoeff()).cwiseQuotient(c.voxel);
        const Oracle oracle(*grid, least.cwiseProduct(least));
        const HyperdiffusionReport report = hyperdiffuse(*grid, c.options);
        const Values expected = twin(oracle, c.options, report);
        EXPECT_LT(test::largest_difference(*grid, oracle, expected), 1e-5 * std::max(oracle.range(), 0.1));
        EXPECT_TRUE(test::inactive_untouched(*grid));
        EXPECT_EQ(report.active_voxels, oracle.size());
        EXPECT_GE(report.cycles, c.options.min_cycles);
        if (c.options.time) {
            EXPECT_NEAR(report.time, *c.options.time, 1e-9 * report.time);
        }
        double removed = 0;
        for (std::size_t i = 0; i < expected.size(); ++i)
            removed += std::pow(expected[i] - oracle.input()[i], 2);
        EXPECT_NEAR(report.removed, std::sqrt(removed / static_cast<double>(expected.size())), 1e-5);
    }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, HyperdiffusionOn, testing::ValuesIn(test::sparse_kinds()), name_of);

// ------------------------------------------------------------------------------------------ equivariance

std::vector<HyperdiffusionOptions> typical() {
    HyperdiffusionOptions q0, q1, q2;
    q0.steps = 10;
    q1.terms = {{1, 1.0}};
    q1.time = 0.3;
    q1.min_cycles = 2;
    q2.terms = {{0, 0.1}, {2, 0.01}};
    q2.sigma = {Kind::global, 2, 0, 1};
    q2.steps = 7;
    q2.fidelity = 0.2;
    return {q0, q1, q2};
}

using Move = std::function<Coord(const Coord&)>;

/// The largest difference between the result moved and the result of what was moved.
double move_error(const openvdb::FloatGrid& input, const HyperdiffusionOptions& o, const Move& move) {
    const auto here = input.deepCopy();
    const auto moved = test::empty_grid();
    for (auto it = input.cbeginValueOn(); it; ++it) moved->tree().setValueOn(move(it.getCoord()), *it);
    hyperdiffuse(*here, o);
    hyperdiffuse(*moved, o);
    double most = 0;
    for (auto it = here->cbeginValueOn(); it; ++it) {
        const double difference = std::abs(moved->tree().getValue(move(it.getCoord())) - *it);
        if (!(difference <= most)) most = difference;
    }
    return most;
}

TEST(Hyperdiffusion, MovesWithTheGrid) {
    const auto corner = test::sparse_grid("leaf corner", 3), cells = test::sparse_grid("cells", 3);
    for (const HyperdiffusionOptions& o : typical()) {
        for (int i = 1; i <= 7; ++i)
            EXPECT_LT(move_error(*corner, o, [i](const Coord& c) { return c.offsetBy(i, 8 - i, 2 * i); }),
                      2e-6);
        EXPECT_LT(move_error(*cells, o, [](const Coord& c) { return c.offsetBy(3, 5, 7); }), 2e-6);
        EXPECT_LT(move_error(*cells, o, [](const Coord& c) { return c.offsetBy(-1000, 77, 65536); }), 2e-6);
    }
}

TEST(Hyperdiffusion, TurnsWithTheGrid) {
    for (const std::string kind : {"leaf corner", "cells"}) {
        const auto input = test::sparse_grid(kind, 4);
        for (const HyperdiffusionOptions& o : typical()) {
            EXPECT_LT(move_error(*input, o, [](const Coord& c) { return Coord(-c.y(), c.x(), c.z()); }),
                      2e-6);
            EXPECT_LT(move_error(*input, o, [](const Coord& c) { return Coord(c.x(), -c.z(), c.y()); }),
                      2e-6);
            EXPECT_LT(move_error(*input, o, [](const Coord& c) { return Coord(c.z(), c.y(), -c.x()); }),
                      2e-6);
        }
    }
}

TEST(Hyperdiffusion, ChangesSignWithTheGrid) {
    const auto input = test::sparse_grid("cells", 5);
    for (const HyperdiffusionOptions& o : typical()) {
        const auto plus = input->deepCopy(), minus = input->deepCopy();
        for (auto it = minus->beginValueOn(); it; ++it) it.setValue(-*it);
        hyperdiffuse(*plus, o);
        hyperdiffuse(*minus, o);
        for (auto it = plus->cbeginValueOn(); it; ++it)
            ASSERT_EQ(minus->tree().getValue(it.getCoord()), -*it);
    }
}

TEST(Hyperdiffusion, GivesTheSameBitsForAnyNumberOfThreads) {
    for (const std::string kind : {"cells", "shell"}) {
        const auto input = test::sparse_grid(kind, 6);
        for (const HyperdiffusionOptions& o : typical()) {
            std::vector<std::uint32_t> first;
            for (const std::size_t threads : {1, 2, 4})
                test::with_threads(threads, [&] {
                    const auto grid = input->deepCopy();
                    hyperdiffuse(*grid, o);
                    if (threads == 1) first = test::bits_of(*grid);
                    EXPECT_EQ(test::bits_of(*grid), first);
                });
        }
    }
}

/// A body longer than a tile along z, that narrows along y: rows that fill a tile's memory lie beside rows
/// that do not, and tiles lack leaves where the tile before had some.
TEST(Hyperdiffusion, OfALongBodyStaysInItsRange) {
    const auto grid = test::empty_grid();
    auto to = grid->getAccessor();
    test::SparseMaker make(7);
    for (int x = -50; x <= 60; ++x)
        for (int y = -75; y <= 75; ++y)
            for (int z = -130; z <= 130; ++z)
                if (x * x + y * y + 0.36 * z * z <= 75 * 75)
                    to.setValueOn(Coord(x + 30, y + 35, z + 70), static_cast<float>(make.uniform()));
    HyperdiffusionOptions o;
    o.sigma = EdgeScale::parse("inf");
    o.steps = 20;
    o.min_cycles = 1;
    for (const int order : {0, 1}) {
        o.terms = {{order, 1.0}};
        const auto smooth = grid->deepCopy();
        const HyperdiffusionReport r = hyperdiffuse(*smooth, o);
        EXPECT_NEAR(r.mean_after, r.mean_before, 1e-6);
        for (auto it = smooth->cbeginValueOn(); it; ++it) ASSERT_TRUE(*it > 0 && *it < 1) << it.getCoord();
    }
}

TEST(Hyperdiffusion, ScalesWithTheValues) {
    const auto input = test::sparse_grid("cells", 7);
    for (const double scale : {1e-8, 1e8})
        for (const HyperdiffusionOptions& o : typical()) {
            const auto grid = input->deepCopy();
            for (auto it = grid->beginValueOn(); it; ++it) it.setValue(static_cast<float>(*it * scale));
            const Oracle oracle(*grid);
            HyperdiffusionOptions cycles = o;  // of one length, as the twin has them
            if (o.steps) cycles.min_cycles = 1;
            const HyperdiffusionReport report = hyperdiffuse(*grid, cycles);
            EXPECT_LT(test::largest_difference(*grid, oracle, twin(oracle, cycles, report)),
                      1e-5 * oracle.range())
                << scale;
        }
}

// ------------------------------------------------------------------------------------- what stays, what
// falls

TEST(Hyperdiffusion, KeepsTheMeanOverAThousandSteps) {
    for (const Stepper stepper : {Stepper::euler, Stepper::fsi})
        for (const int q : {0, 1, 2})
            for (const Kind kind : {Kind::infinite, Kind::local}) {
                // A thousand steps take their time: one case on several cells, the others in one leaf.
                const auto grid = rescaled(
                    test::sparse_grid(kind == Kind::infinite && q == 1 ? "few leaves" : "inside a leaf", 8),
                    1, 2);
                HyperdiffusionOptions o;
                o.terms = {{q, 1.0}};
                o.sigma.kind = kind;
                o.stepper = stepper;
                o.steps = 1000;
                const Oracle before(*grid);
                const HyperdiffusionReport report = hyperdiffuse(*grid, o);
                const Oracle after(*grid);
                double x = 0, u = 0;
                for (std::size_t i = 0; i < before.size(); ++i) {
                    x += before.input()[i] / static_cast<double>(before.size());
                    u += after.input()[i] / static_cast<double>(before.size());
                }
                EXPECT_NEAR(u, x, 1e-6 * x) << "order " << q;
                EXPECT_NEAR(report.mean_before, x, 1e-9);
                EXPECT_NEAR(report.mean_after, u, 1e-6 * x);
                EXPECT_EQ(report.steps, 1000);
            }
}

TEST(Hyperdiffusion, KeepsConstantsToTheLastBit) {
    for (const HyperdiffusionOptions& o : typical())
        for (const float value : {0.0f, -3.7f, 1e8f, 1e-8f}) {
            const auto grid = test::sparse_grid("cells", 9);
            for (auto it = grid->beginValueOn(); it; ++it) it.setValue(value);
            const auto before = test::bits_of(*grid);
            hyperdiffuse(*grid, o);
            EXPECT_EQ(test::bits_of(*grid), before);
        }
}

TEST(Hyperdiffusion, KeepsRampsAwayFromTheBorder) {
    const auto ramp = [](const Coord& c) { return 0.5 * c.x() - 0.25 * c.y() + 0.125 * c.z(); };
    const openvdb::CoordBBox box = test::box_of(Coord(-3, 5, 9), 40, 40, 40);
    for (const int q : {1, 2, 3}) {
        const auto grid = test::box_grid(box, ramp);
        HyperdiffusionOptions o;
        o.terms = {{q, 1.0}};
        o.sigma = no_edges;
        o.steps = 4;
        hyperdiffuse(*grid, o);
        openvdb::CoordBBox inside = box;
        inside.expand(-4 * (q + 1));
        for (auto c = inside.begin(); c; ++c)
            ASSERT_NEAR(grid->tree().getValue(*c), ramp(*c), 1e-5) << "order " << q;
    }
}

TEST(Hyperdiffusion, NeverAddsToTheEnergyOfItsOrder) {
    for (const std::string kind : {"leaf corner", "few leaves"})
        for (const Stepper stepper : {Stepper::euler, Stepper::fsi})
            for (const int q : {0, 1, 2, 3}) {
                const auto grid = test::sparse_grid(kind, 10);
                HyperdiffusionOptions o;
                o.terms = {{q, 1.0}};
                o.stepper = stepper;
                o.steps = stepper == Stepper::fsi ? 12 : 1;
                o.dt = 2 / o.largest_rate(Vec3d::Ones());
                double before = infinity;
                for (int k = 0; k < 6; ++k) {
                    const Oracle u(*grid);
                    const Values high = u.power(u.input(), q);
                    double energy = 0;
                    for (std::size_t i = 0; i < high.size(); ++i) energy += u.input()[i] * high[i];
                    EXPECT_LE(energy, before * (1 + 1e-6)) << kind << ", order " << q;
                    before = energy;
                    hyperdiffuse(*grid, o);
                }
            }
}

// ------------------------------------------------------------------------------------------ odd input

TEST(Hyperdiffusion, OfNothingAndOfNoTimeIsTheInput) {
    const auto nothing = test::empty_grid();
    for (HyperdiffusionOptions o : typical()) {
        const HyperdiffusionReport report = hyperdiffuse(*nothing, o);
        EXPECT_EQ(report.active_voxels, 0u);
        EXPECT_EQ(report.steps, 0);
        const auto input = test::sparse_grid("cells", 11), grid = input->deepCopy();
        o.steps.reset();
        o.time = 0;
        EXPECT_EQ(hyperdiffuse(*grid, o).steps, 0);
        EXPECT_EQ(test::bits_of(*grid), test::bits_of(*input));
        o.time.reset();
        o.steps = 0;
        EXPECT_EQ(hyperdiffuse(*grid, o).time, 0);
        EXPECT_EQ(test::bits_of(*grid), test::bits_of(*input));
    }
}

TEST(Hyperdiffusion, OfOneVoxelIsThatVoxel) {
    for (const HyperdiffusionOptions& o : typical()) {
        const auto grid = test::empty_grid();
        grid->tree().setValueOn(Coord(-9, 31, 64), 42.5f);
        EXPECT_EQ(hyperdiffuse(*grid, o).active_voxels, 1u);
        EXPECT_EQ(grid->tree().getValue(Coord(-9, 31, 64)), 42.5f);
    }
}

TEST(Hyperdiffusion, TakesActiveTiles) {
    const auto tiles = test::empty_grid(), leaves = test::empty_grid();
    tiles->tree().addTile(1, Coord(8), 2.0f, true);
    for (auto c = openvdb::CoordBBox::createCube(Coord(8), 8).begin(); c; ++c)
        leaves->tree().setValueOn(*c, 2.0f);
    for (const auto& grid : {tiles, leaves}) grid->tree().setValueOn(Coord(7, 9, 10), 1.0f);
    HyperdiffusionOptions o;
    o.steps = 5;
    EXPECT_EQ(hyperdiffuse(*tiles, o).active_voxels, 513u);
    hyperdiffuse(*leaves, o);
    EXPECT_EQ(test::bits_of(*tiles), test::bits_of(*leaves));
}

TEST(Hyperdiffusion, RefusesWhatIsNotFiniteAndTouchesNothing) {
    for (const float odd : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity()}) {
        const auto grid = test::sparse_grid("cells", 12);
        grid->tree().setValueOn(grid->cbeginValueOn().getCoord(), odd);
        const auto before = test::bits_of(*grid);
        for (const HyperdiffusionOptions& o : typical()) EXPECT_THROW(hyperdiffuse(*grid, o), InvalidInput);
        EXPECT_EQ(test::bits_of(*grid), before);
    }
}

TEST(Hyperdiffusion, RefusesAStepAboveTheBoundAndNamesIt) {
    const auto input = test::sparse_grid("few leaves", 13);
    for (const Stepper stepper : {Stepper::euler, Stepper::fsi}) {
        HyperdiffusionOptions o;
        o.terms = {{1, 2.0}, {0, 0.5}};
        o.fidelity = 1;
        o.stepper = stepper;
        o.steps = 3;
        const double bound = 2 / (2.0 * 144 + 0.5 * 12 + 1);
        EXPECT_NEAR(o.largest_rate(Vec3d::Ones()), 2 / bound, 1e-9);
        const auto grid = input->deepCopy();
        o.dt = bound * 1.001;
        try {
            hyperdiffuse(*grid, o);
            FAIL() << "a step above the bound was taken";
        } catch (const InvalidInput& e) {
            EXPECT_NE(std::string(e.what()).find("0.0067796"), std::string::npos) << e.what();
        }
        EXPECT_EQ(test::bits_of(*grid), test::bits_of(*input));
        o.dt = bound * 0.999999;
        EXPECT_NO_THROW(hyperdiffuse(*grid, o));
        o.dt.reset();
        EXPECT_NEAR(hyperdiffuse(*grid, o).dt, 0.9 * bound, 1e-9);
    }
}

TEST(Hyperdiffusion, RefusesBadOptions) {
    const auto refused = [](const std::function<void(HyperdiffusionOptions&)>& change) {
        HyperdiffusionOptions o;
        o.time = 1;
        EXPECT_NO_THROW(o.check());
        change(o);
        EXPECT_THROW(o.check(), InvalidInput);
        const auto grid = test::sparse_grid("one voxel", 1);
        EXPECT_THROW(hyperdiffuse(*grid, o), InvalidInput);
    };
    using O = HyperdiffusionOptions;
    const double nan = std::nan("");
    refused([](O& o) { o.terms.clear(); });
    refused([](O& o) { o.terms = {{-1, 1.0}}; });
    refused([](O& o) { o.terms = {{16, 1.0}}; });
    refused([](O& o) { o.terms = {{1, 1.0}, {1, 2.0}}; });
    for (const double d : {0.0, -1.0, nan, infinity}) refused([d](O& o) { o.terms = {{0, d}}; });
    for (const double t : {-1.0, nan, infinity}) refused([t](O& o) { o.time = t; });
    refused([](O& o) { o.steps = 3; });
    refused([](O& o) {
        o.time.reset();
        o.steps = -1;
    });
    for (const double dt : {0.0, -1.0, nan, infinity}) refused([dt](O& o) { o.dt = dt; });
    for (const int n : {0, -3, 301}) refused([n](O& o) { o.cycle = n; });
    refused([](O& o) { o.min_cycles = 0; });
    for (const double b : {-1.0, nan, infinity}) refused([b](O& o) { o.fidelity = b; });
    for (const int r : {0, 9, -1}) refused([r](O& o) { o.sigma.radius = r; });
    for (const double v : {0.0, -1.0, nan}) {
        refused([v](O& o) { o.sigma = {Kind::value, 2, v, 1}; });
        refused([v](O& o) { o.sigma.factor = v; });
    }
}

TEST(Hyperdiffusion, StopsWhenToldToAndTouchesNothing) {
    const auto grid = test::sparse_grid("cells", 14);
    const auto before = test::bits_of(*grid);
    HyperdiffusionOptions o;
    o.time = 20;
    int calls = 0;
    EXPECT_THROW(hyperdiffuse(*grid, o, Progress([&](double) { return ++calls < 4; })), Cancelled);
    EXPECT_EQ(test::bits_of(*grid), before);
    double last = 0;
    bool rises = true;
    hyperdiffuse(*grid, o, Progress([&](double f) {
        rises = rises && f >= last - 1e-12;
        last = f;
        return true;
    }));
    EXPECT_TRUE(rises);
    EXPECT_NEAR(last, 1, 1e-9);
}

TEST(Hyperdiffusion, TakesItsTimeFromTheNoise) {
    const auto clean = [](const Coord& c) {
        return 5 * std::sin(0.2 * c.x()) * std::cos(0.15 * c.y()) + 0.1 * c.z();
    };
    test::SparseMaker random(15);
    const auto grid = test::box_grid(test::box_of(Coord(-10), 40, 40, 40), [&](const Coord& c) {
        double sum = 0;  // of twelve: variance 1
        for (int i = 0; i < 12; ++i) sum += random.uniform() - 0.5;
        return clean(c) + sum;
    });
    const auto error = [&] {
        double sum = 0;
        for (auto it = grid->cbeginValueOn(); it; ++it) sum += std::pow(*it - clean(it.getCoord()), 2);
        return std::sqrt(sum / 64000);
    };
    EXPECT_NEAR(error(), 1, 0.02);
    const HyperdiffusionReport report = hyperdiffuse(*grid, {});
    EXPECT_TRUE(report.automatic);
    EXPECT_NEAR(report.noise, 1, 0.05);
    EXPECT_GT(report.time, 0);
    EXPECT_LT(error(), 0.5);
}

/// Little noise on a structure that the first cycle would blur: the time is taken back to where the noise is
/// gone.
TEST(Hyperdiffusion, ATimeThatWasTooLongIsTakenBack) {
    test::SparseMaker random(16);
    const auto grid = test::box_grid(test::box_of(Coord(-10), 40, 40, 40), [&](const Coord& c) {
        return std::sin(0.9 * c.x()) * std::cos(0.8 * c.y()) + 0.02 * (random.uniform() - 0.5);
    });
    HyperdiffusionOptions once;
    once.steps = 21;
    once.cycle = 21;
    once.min_cycles = 1;
    const HyperdiffusionReport first = hyperdiffuse(*grid->deepCopy(), once);
    const HyperdiffusionReport chosen = hyperdiffuse(*grid, {});
    ASSERT_GT(first.removed, 1.2 * chosen.noise);
    EXPECT_GT(chosen.time, 0);
    EXPECT_LT(chosen.time, first.time);
    EXPECT_LT(chosen.removed, first.removed);
}

// ------------------------------------------------------------------------------------------ small things

TEST(AxisWeights, AreTheSquaredRatiosOfTheVoxelSizes) {
    const auto weights = [](const openvdb::Vec3d& h) {
        const auto t = openvdb::math::Transform::createLinearTransform(1.0);
        t->postScale(h);
        return axis_weights(*t);
    };
    EXPECT_EQ(weights({2.5, 2.5, 2.5}), Vec3d(1, 1, 1));
    EXPECT_EQ(weights({1.06, 1.06000004, 1.06}), Vec3d(1, 1, 1));
    EXPECT_LT((weights({2, 1, 4}) - Vec3d(0.25, 1, 0.0625)).norm(), 1e-12);
}

TEST(EdgeScale, IsReadAndWritten) {
    for (const std::string text : {"local:1", "local:2", "local:8", "global", "inf", "0.25", "1e-09"})
        EXPECT_EQ(EdgeScale::parse(text).text(), text);
    EXPECT_EQ(EdgeScale::parse("local").radius, 2);
    EXPECT_EQ(EdgeScale::parse("0.25").value, 0.25);
    for (const std::string text :
         {"", "local:", "local:0", "local:9", "local:2x", "local2", "local: ", "locally", "local:4294967298",
          "globale", "0", "-1", "nan", "infinite", "-inf", "3 4", "1e999"})
        EXPECT_THROW(EdgeScale::parse(text), InvalidInput) << text;
}

}  // namespace
}  // namespace vdbgeo
