#include "vdbgeo/stencil/line_solve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/stencil/bricks.h"
#include "tests/support/grids.h"
#include "tests/support/line_oracle.h"
#include "vdbgeo/stencil/plane_kernels.h"

namespace vdbgeo {
namespace {

using stencil::BlockLayout;
using test::LineTerm;
using test::Oracle;
using test::Values;

struct Case {
    std::string name;
    std::vector<int> orders;
    std::vector<bool> variable;
    std::vector<double> factors;
    Vec3d weights = Vec3d::Ones();
};

std::vector<Case> cases() {
    const Vec3d flat(1, 0.36, 0.09);
    return {{"q0", {0}, {false}, {1.0}},
            {"q0 variable", {0}, {true}, {0.7}},
            {"q1", {1}, {false}, {1.0}},
            {"q1 variable, flat voxels", {1}, {true}, {1.0}, flat},
            {"q2 variable", {2}, {true}, {2.0}},
            {"q3 variable", {3}, {true}, {1.0}},
            {"q3, flat voxels", {3}, {false}, {1.0}, flat},
            {"sum of 0 and 2", {0, 2}, {true, true}, {1.0, 0.1}},
            {"sum of 0, 1 and 3", {0, 1, 3}, {false, true, true}, {0.5, 0.2, 0.01}, flat}};
}

/// A random right side and random diffusivities on the mask of a grid.
class Setting {
 public:
    Setting(const openvdb::FloatGrid& grid, const Case& c)
        : case_(c), layout_(grid.tree()), oracle_(grid), v_(bricks(oracle_.input(), 0)) {
        test::SparseMaker make(23);
        for (std::size_t t = 0; t < c.orders.size(); ++t) {
            Values d(oracle_.size(), 1.0);
            // From edges that let nearly nothing through up to 1.
            if (c.variable[t])
                for (double& x : d) x = static_cast<float>(std::exp(-12 * make.uniform() * make.uniform()));
            d_.push_back(bricks(d, stencil::inactive));
            twin_terms_.push_back({c.orders[t], c.factors[t], d});
        }
    }

    const BlockLayout& layout() const { return layout_; }
    const Oracle& oracle() const { return oracle_; }
    const std::vector<float>& start() const { return v_; }
    std::vector<float> run(double c) const {
        std::vector<stencil::SweepTerm> terms;
        for (std::size_t t = 0; t < case_.orders.size(); ++t)
            terms.push_back({case_.orders[t], case_.variable[t] ? d_[t].data() : nullptr, case_.factors[t]});
        std::vector<float> v = v_;
        stencil::solve_lines(layout_, terms, case_.weights, c, v.data());
        return v;
    }
    Values expected(double c) const {
        return test::solve_lines(oracle_, twin_terms_, case_.weights, c, oracle_.input());
    }

 private:
    std::vector<float> bricks(const Values& values, float absent) const {
        std::vector<float> out(layout_.brick_count() * 512);
        test::to_bricks(layout_, oracle_, values, absent, out.data());
        return out;
    }
    Case case_;
    BlockLayout layout_;
    Oracle oracle_;
    std::vector<float> v_;
    std::vector<std::vector<float>> d_;
    std::vector<LineTerm> twin_terms_;
};

class LineSolveOn : public testing::TestWithParam<std::string> {};

TEST_P(LineSolveOn, AgreesWithTheDenseMatrix) {
    const auto grid = test::sparse_grid(GetParam(), 5);
    for (const Case& k : cases())
        for (const double c : {0.01, 1.0, 300.0}) {
            SCOPED_TRACE(k.name + ", c " + std::to_string(c));
            const Setting setting(*grid, k);
            const Values expected = setting.expected(c);
            double size = 1;
            for (const double x : expected) size = std::max(size, std::abs(x));
            EXPECT_LT(
                test::largest_difference(setting.layout(), setting.run(c).data(), setting.oracle(), expected),
                3e-6 * size);
        }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
    std::string out = info.param;
    std::replace(out.begin(), out.end(), ' ', '_');
    return out;
}

INSTANTIATE_TEST_SUITE_P(Masks, LineSolveOn, testing::ValuesIn(test::sparse_kinds()), name_of);

/// Through many leaves and cells in a line, at negative coordinates, along each axis.
TEST(LineSolve, GoesThroughLeavesAndCells) {
    for (const openvdb::Coord& size :
         {openvdb::Coord(150, 2, 1), openvdb::Coord(1, 150, 2), openvdb::Coord(2, 1, 150)}) {
        test::SparseMaker make(3);
        const auto grid =
            test::box_grid(test::box_of(openvdb::Coord(-77, -70, -75), size.x(), size.y(), size.z()),
                           [&](const openvdb::Coord&) { return 2 * make.uniform() - 1; });
        for (const Case& k : cases()) {
            SCOPED_TRACE(k.name);
            const Setting setting(*grid, k);
            EXPECT_LT(test::largest_difference(setting.layout(), setting.run(5).data(), setting.oracle(),
                                               setting.expected(5)),
                      1e-5);
        }
    }
}

TEST(LineSolve, LeavesSingleVoxelsAndConstantsAsTheyAre) {
    const auto apart = test::empty_grid();
    for (int i = 0; i < 30; ++i)
        apart->tree().setValueOn(openvdb::Coord(2 * i - 31, (i % 3) - 1, (i % 5) - 2), float(i) / 7);
    for (const Case& k : cases()) {
        const Setting setting(*apart, k);
        EXPECT_EQ(setting.run(10), setting.start()) << k.name;
    }
    const auto constant = test::sparse_grid("cells", 4);
    for (auto it = constant->beginValueOn(); it; ++it) it.setValue(0.75f);
    for (const Case& k : cases()) {
        const Setting setting(*constant, k);
        EXPECT_LT(test::largest_difference(setting.layout(), setting.run(10).data(), setting.oracle(),
                                           Values(setting.oracle().size(), 0.75)),
                  1e-7)
            << k.name;
    }
}

TEST(LineSolve, OfNothingDoesNothing) {
    const auto grid = test::sparse_grid("cells", 6);
    for (const Case& k : cases()) {
        const Setting setting(*grid, k), empty(*test::empty_grid(), k);
        EXPECT_EQ(setting.run(0), setting.start()) << k.name;
        EXPECT_TRUE(empty.run(1).empty()) << k.name;
    }
}

TEST(LineSolve, KeepsTheSum) {
    const auto grid = test::sparse_grid("cells", 7);
    for (const Case& k : cases()) {
        const Setting setting(*grid, k);
        const auto before = stencil::summarize(setting.layout(), setting.start().data());
        const auto after = stencil::summarize(setting.layout(), setting.run(20).data());
        EXPECT_NEAR(after.mean(), before.mean(), 1e-7) << k.name;
    }
}

TEST(LineSolve, GivesTheSameBitsForAnyNumberOfThreads) {
    const auto grid = test::sparse_grid("cells", 8);
    for (const Case& k : cases()) {
        const Setting setting(*grid, k);
        std::vector<float> first;
        test::with_threads(1, [&] { first = setting.run(3); });
        for (const std::size_t threads : {2, 4})
            test::with_threads(threads, [&] { EXPECT_EQ(setting.run(3), first) << k.name; });
    }
}

}  // namespace
}  // namespace vdbgeo
