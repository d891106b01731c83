#include "vdbgeo/flow/pde_transform.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/cosine_modes.h"
#include "tests/support/dense_oracle.h"
#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/flow/diffusion_solver.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using test::Oracle;
using test::Values;

struct Modes {
    std::vector<openvdb::FloatGrid::Ptr> grids;
    std::vector<HyperdiffusionReport> reports;
};

Modes transform(const openvdb::FloatGrid& grid, const TransformOptions& options) {
    Modes m;
    pde_transform(grid, options,
                  [&](int index, openvdb::FloatGrid::Ptr mode, const HyperdiffusionReport& report) {
                      EXPECT_EQ(index, static_cast<int>(m.grids.size()));
                      m.grids.push_back(mode);
                      m.reports.push_back(report);
                  });
    return m;
}

std::vector<TransformOptions> cases() {
    TransformOptions two, orders, edges, euler;
    two.passes = edges.passes = {{1, 1.0}, {1, 6.0}};
    orders.passes = {{0, 0.3}, {3, 0.01}, {2, 1}, {0, 5}};
    edges.sigma = {};
    euler.passes = {{1, 0.05}, {0, 1}};
    euler.stepper = Stepper::euler;
    return {two, orders, edges, euler};
}

TEST(PdeTransform, ModesAndResidueAddUpToTheInput) {
    for (const std::string& kind : test::sparse_kinds())
        for (const TransformOptions& o : cases())
            for (const double scale : {1.0, 1e-8, 1e8}) {
                if (scale != 1 && kind != "leaf corner") continue;
                const auto input = test::sparse_grid(kind, 51);
                for (auto it = input->beginValueOn(); it; ++it)
                    it.setValue(static_cast<float>((*it + 0.5) * scale));
                const auto before = test::bits_of(*input);
                const Modes m = transform(*input, o);
                EXPECT_EQ(test::bits_of(*input), before);
                ASSERT_EQ(m.grids.size(), o.passes.size() + 1);
                const Oracle oracle(*input);
                Values sum(oracle.size());
                for (const auto& g : m.grids) {
                    EXPECT_EQ(g->activeVoxelCount(), oracle.size());
                    EXPECT_TRUE(test::inactive_untouched(*g));
                    for (std::size_t i = 0; i < sum.size(); ++i)
                        sum[i] += g->tree().getValue(oracle.voxel(i));
                }
                EXPECT_LT(test::largest_difference(*input, oracle, sum), 1e-6 * scale) << kind;
            }
}

TEST(PdeTransform, ModesAreWhatEachLowPassTakesAway) {
    const auto input = test::sparse_grid("cells", 52);
    const TransformOptions o = cases()[1];
    const Modes m = transform(*input, o);
    const auto rest = input->deepCopy();
    for (std::size_t k = 0; k < o.passes.size(); ++k) {
        const auto before = rest->deepCopy();
        HyperdiffusionOptions low;
        low.terms = {{o.passes[k].order, 1.0}};
        low.sigma = o.sigma;
        low.time = o.passes[k].time;
        const HyperdiffusionReport report = hyperdiffuse(*rest, low);
        EXPECT_EQ(m.reports[k].steps, report.steps);
        EXPECT_NEAR(m.reports[k].time, o.passes[k].time, 1e-9);
        for (auto it = before->cbeginValueOn(); it; ++it)
            ASSERT_EQ(m.grids[k]->tree().getValue(it.getCoord()), *it - rest->tree().getValue(it.getCoord()));
    }
    EXPECT_EQ(test::bits_of(*m.grids.back()), test::bits_of(*rest));
}

/// Each cosine wave goes to the modes by its transfer factors.
TEST(PdeTransform, WavesGoFromFineToCoarse) {
    const test::CosineBox box = test::cosine_box();
    const TransformOptions o;
    const Modes m = transform(*box.grid(), o);
    std::vector<double> left(box.modes.size(), 1.0);
    for (std::size_t k = 0; k < o.passes.size(); ++k) {
        std::vector<double> amplitudes;
        const double bound = 2 / std::pow(12.0, o.passes[k].order + 1);
        const std::vector<CycleRun> cycles =
            cycles_for_time(Stepper::fsi, o.passes[k].time, 0.9 * bound, {o.passes[k].order, {}, 3});
        for (std::size_t i = 0; i < left.size(); ++i) {
            const double rate = std::pow(box.modes[i].eigenvalue(), o.passes[k].order + 1);
            test::State s{{left[i]}};
            for (const CycleRun& run : cycles)
                for (int c = 0; c < run.cycles; ++c)
                    s = test::fsi_cycle(s, run.n, run.tau,
                                        [&](const test::State& u) { return test::State{{-rate * u[0][0]}}; });
            amplitudes.push_back(left[i] - s[0][0]);
            left[i] = s[0][0];
        }
        EXPECT_LT(box.difference(*m.grids[k], amplitudes), 1e-5) << "mode " << k;
        if (k == 0) {
            EXPECT_GT(amplitudes.back(), 0.9) << "the roughest wave is in the first mode";
            EXPECT_LT(amplitudes.front(), 0.1);
        }
    }
    EXPECT_LT(box.difference(*m.grids.back(), left), 1e-5);
}

TEST(PdeTransform, OfNothingIsNothing) {
    const Modes m = transform(*test::empty_grid(), {});
    ASSERT_EQ(m.grids.size(), 4u);
    for (const auto& g : m.grids) EXPECT_EQ(g->activeVoxelCount(), 0u);
}

TEST(PdeTransform, OfActiveTilesAddsUp) {
    const auto tiles = test::empty_grid();
    tiles->tree().addTile(1, Coord(8), 2.0f, true);
    tiles->tree().setValueOn(Coord(7, 9, 10), 1.0f);
    const Modes m = transform(*tiles, {});
    EXPECT_TRUE(tiles->tree().hasActiveTiles());
    for (const Coord& c : {Coord(7, 9, 10), Coord(8, 9, 10), Coord(15, 15, 15)}) {
        double sum = 0;
        for (const auto& g : m.grids) sum += g->tree().getValue(c);
        EXPECT_NEAR(sum, tiles->tree().getValue(c), 1e-6);
    }
}

TEST(PdeTransform, RefusesBadInput) {
    const auto grid = test::sparse_grid("one voxel", 1);
    const auto nothing = [](int, const openvdb::FloatGrid::Ptr&, const HyperdiffusionReport&) {};
    TransformOptions o;
    o.passes.clear();
    EXPECT_THROW(pde_transform(*grid, o, nothing), InvalidInput);
    for (const TransformOptions::Pass& p : {TransformOptions::Pass{-1, 1},
                                            {16, 1},
                                            {1, -1},
                                            {1, std::nan("")},
                                            {1, std::numeric_limits<double>::infinity()}}) {
        o.passes = {p};
        EXPECT_THROW(pde_transform(*grid, o, nothing), InvalidInput);
    }
    grid->tree().setValueOn(grid->cbeginValueOn().getCoord(), std::numeric_limits<float>::quiet_NaN());
    EXPECT_THROW(pde_transform(*grid, {}, nothing), InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
