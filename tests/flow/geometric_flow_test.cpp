#include "vdbgeo/flow/geometric_flow.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <map>
#include <random>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;

using Field = std::map<Coord, double>;

/// Eq 5 voxel by voxel in double, as the header has it.
class Twin {
 public:
    Twin(const FloatGrid& grid, const GeometricFlowOptions& o) : o_(o), w_(axis_weights(grid.transform())) {
        for (auto it = grid.cbeginValueOn(); it; ++it) input_[it.getCoord()] = *it;
    }

    Field rate(const Field& s) {
        Field w = s;
        for (int q = 0; q < o_.order; ++q) {
            Field next;
            for (const auto& [c, v] : w) {
                double sum = 0;
                for (int a = 0; a < 3; ++a)
                    for (int d : {-1, 1}) sum += w_[a] * (v - at(w, c, step(c, a, d)));
                next[c] = sum;
            }
            w = std::move(next);
        }
        Field out;
        largest_row_ = 0;
        for (const auto& [c, v] : w) {
            double sum = 0, row = 0;
            for (int a = 0; a < 3; ++a)
                for (int d : {-1, 1}) {
                    const Coord n = step(c, a, d);
                    if (!w.count(n)) continue;
                    const double f = w_[a] / root_of_face(w, c, n, a);
                    sum += f * (w.at(n) - v);
                    row += f;
                }
            double g = 1;
            for (int a = 0; a < 3; ++a) g += std::pow(slope(w, c, a), 2);
            largest_row_ = std::max(largest_row_, row * std::sqrt(g));
            out[c] = std::sqrt(g) * sum + o_.fidelity * (input_.at(c) - s.at(c)) + pressure(s, c);
        }
        return out;
    }

    Field run(double dt, int steps) {
        Field s = input_;
        for (int i = 0; i < steps; ++i)
            for (const auto& [c, r] : rate(s)) s[c] += dt * r;
        return s;
    }

    double bound() {
        rate(input_);
        return 2 / (2 * largest_row_ * std::pow(4 * w_.sum(), o_.order) + o_.fidelity +
                    2 * std::abs(o_.pressure) * std::sqrt(w_.sum()));
    }

 private:
    static Coord step(Coord c, int a, int d) {
        c[a] += d;
        return c;
    }
    static double at(const Field& f, const Coord& self, const Coord& c) {
        const auto it = f.find(c);
        return it == f.end() ? f.at(self) : it->second;
    }
    double slope(const Field& w, const Coord& c, int a) const {
        return std::sqrt(w_[a]) * (at(w, c, step(c, a, 1)) - at(w, c, step(c, a, -1))) / 2 / o_.scale;
    }
    double root_of_face(const Field& w, const Coord& c, const Coord& n, int a) const {
        double g = 1 + w_[a] * std::pow((w.at(n) - w.at(c)) / o_.scale, 2);
        for (int b = 0; b < 3; ++b)
            if (b != a) g += std::pow((slope(w, c, b) + slope(w, n, b)) / 2, 2);
        return std::sqrt(g);
    }
    double pressure(const Field& s, const Coord& c) const {
        const double sign = o_.pressure > 0 ? 1 : -1;
        double sum = 0;
        for (int a = 0; a < 3; ++a) {
            double most = 0;
            for (int d : {-1, 1}) most = std::max(most, sign * (at(s, c, step(c, a, d)) - s.at(c)));
            sum += w_[a] * most * most;
        }
        return o_.pressure * std::sqrt(sum);
    }

    GeometricFlowOptions o_;
    Vec3d w_;
    Field input_;
    double largest_row_ = 0;
};

/// Random values on a random part of a box that lies across borders of leaves and of cells.
FloatGrid::Ptr random_grid(unsigned seed, double density, const Coord& from = Coord(-7, 25, 57),
                           int size = 15) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> value(0, 1);
    auto grid = FloatGrid::create(0.25f);
    for (int x = 0; x < size; ++x)
        for (int y = 0; y < size; ++y)
            for (int z = 0; z < size; ++z)
                if (value(random) < density) grid->tree().setValue(from.offsetBy(x, y, z), value(random));
    return grid;
}

void expect_as_twin(const FloatGrid::Ptr& grid, GeometricFlowOptions o, double dt_share, int steps) {
    Twin twin(*grid, o);
    o.dt = dt_share * twin.bound();
    o.time = *o.dt * steps;
    const Field expected = twin.run(*o.dt, steps);
    const auto before = grid->deepCopy();
    const HyperdiffusionReport report = geometric_flow(*grid, o);
    EXPECT_EQ(report.steps, steps);
    EXPECT_EQ(report.active_voxels, before->activeVoxelCount());
    ASSERT_EQ(grid->activeVoxelCount(), before->activeVoxelCount());
    double moved = 0;
    for (const auto& [c, v] : expected) {
        ASSERT_NEAR(grid->tree().getValue(c), v, 1e-5) << c;
        moved = std::max(moved, std::abs(v - before->tree().getValue(c)));
    }
    EXPECT_GT(moved, 1e-3);
}

class Order : public testing::TestWithParam<int> {};

TEST_P(Order, AgreesWithTheTwinOnSparseMasks) {
    GeometricFlowOptions o;
    o.order = GetParam();
    o.scale = GetParam() == 0 ? 0.3 : 3;
    expect_as_twin(random_grid(1, 0.7), o, 0.5, 3);
    expect_as_twin(random_grid(2, 0.2), o, 0.5, 3);
    expect_as_twin(random_grid(3, 1.0), o, 0.5, 3);
}

TEST_P(Order, AgreesWithTheTwinWithPressureAndFidelity) {
    GeometricFlowOptions o;
    o.order = GetParam();
    o.fidelity = 2;
    o.pressure = 0.5;
    expect_as_twin(random_grid(4, 0.7), o, 0.5, 3);
    o.pressure = -1.5;
    expect_as_twin(random_grid(5, 0.7), o, 0.5, 3);
}

TEST_P(Order, AgreesWithTheTwinOnVoxelsThatAreNotCubic) {
    GeometricFlowOptions o;
    o.order = GetParam();
    auto grid = random_grid(6, 0.8);
    auto transform = openvdb::math::Transform::createLinearTransform(1);
    transform->preScale(openvdb::Vec3d(2, 1, 1.5));
    grid->setTransform(transform);
    expect_as_twin(grid, o, 0.5, 3);
}

TEST_P(Order, TheStepIsNineTenthsOfTheBound) {
    auto grid = random_grid(7, 0.8);
    GeometricFlowOptions o;
    o.order = GetParam();
    o.fidelity = 0.5;
    o.pressure = 1;
    const double bound = Twin(*grid, o).bound();
    o.time = bound;
    const HyperdiffusionReport report = geometric_flow(*grid, o);
    EXPECT_NEAR(report.dt, 0.9 * bound, 1e-5 * bound);
    EXPECT_EQ(report.steps, 2);
    EXPECT_NEAR(report.time, bound, 1e-9);
}

TEST_P(Order, ConstantsStay) {
    auto grid = FloatGrid::create(0);
    grid->fill(openvdb::CoordBBox(Coord(-3), Coord(12)), 2.5f);
    GeometricFlowOptions o;
    o.order = GetParam();
    o.pressure = 1;
    const HyperdiffusionReport report = geometric_flow(*grid, o);
    for (auto it = grid->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, 2.5f);
    EXPECT_EQ(report.removed, 0);
    EXPECT_GT(report.steps, 0);
}

TEST_P(Order, TheSameBitsForAnyNumberOfThreads) {
    GeometricFlowOptions o;
    o.order = GetParam();
    o.time = 0.2 / std::pow(12, o.order);
    o.fidelity = 0.1;
    std::array<FloatGrid::Ptr, 2> results;
    for (std::size_t i = 0; i < 2; ++i) {
        const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, i == 0 ? 1 : 4);
        results[i] = random_grid(8, 0.5, Coord(-20), 40);
        geometric_flow(*results[i], o);
    }
    for (auto it = results[0]->cbeginValueOn(); it; ++it)
        ASSERT_EQ(*it, results[1]->tree().getValue(it.getCoord()));
}

INSTANTIATE_TEST_SUITE_P(Orders, Order, testing::Values(0, 1, 2), testing::PrintToStringParamName());

TEST(GeometricFlow, AParaboloidMovesByItsMeanCurvature) {
    // S = a |x|²/2: S_t = ΔS − S_i S_j S_ij / g = 3a − a (a|x|)² / (1 + (a|x|)²).
    const double a = 0.1;
    const int n = 10;
    auto grid = FloatGrid::create(0);
    for (int x = -n; x <= n; ++x)
        for (int y = -n; y <= n; ++y)
            for (int z = -n; z <= n; ++z)
                grid->tree().setValue(Coord(x, y, z), static_cast<float>(a * (x * x + y * y + z * z) / 2));
    const auto before = grid->deepCopy();
    GeometricFlowOptions o;
    o.time = 0.02;
    geometric_flow(*grid, o);
    double least = 1;
    for (int x = -6; x <= 6; ++x)
        for (int y = -6; y <= 6; ++y)
            for (int z = -6; z <= 6; ++z) {
                const Coord c(x, y, z);
                const double s2 = a * a * (x * x + y * y + z * z);
                const double exact = 3 * a - a * s2 / (1 + s2);
                const double rate = (grid->tree().getValue(c) - before->tree().getValue(c)) / o.time;
                ASSERT_NEAR(rate, exact, 0.01 * exact) << c;
                least = std::min(least, exact);
            }
    EXPECT_LT(least, 0.85 * 3 * a);  // not just the Laplacian
}

TEST(GeometricFlow, TheFlatLimitIsDiffusion) {
    // With a large scale g = 1, and a cosine decays as by the heat equation.
    const int n = 16;
    const double pi = 3.14159265358979323846, lambda = 2 * (1 - std::cos(pi / n));
    for (const int q : {0, 1, 3}) {
        auto grid = FloatGrid::create(0);
        for (int x = 0; x < n; ++x)
            for (int y = 0; y < n; ++y)
                for (int z = 0; z < n; ++z)
                    grid->tree().setValue(Coord(x, y, z), static_cast<float>(std::cos(pi * (z + 0.5) / n)));
        GeometricFlowOptions o;
        o.order = q;
        o.scale = 1e4;
        o.dt = 1.0 / std::pow(12, q + 1);
        o.time = *o.dt * 5;
        geometric_flow(*grid, o);
        const double expected = std::pow(1 - *o.dt * std::pow(lambda, q + 1), 5) * std::cos(pi * 0.5 / n);
        EXPECT_NEAR(grid->tree().getValue(Coord(3, 4, 0)), expected, 2e-6) << q;
    }
}

TEST(GeometricFlow, InactiveVoxelsAndTilesAreKept) {
    auto grid = FloatGrid::create(0.25f);
    grid->sparseFill(openvdb::CoordBBox(Coord(0), Coord(15, 15, 15)), 1.0f);
    grid->tree().setValueOff(Coord(3, 3, 3), 7.0f);
    grid->tree().setValue(Coord(20, 0, 0), 5.0f);
    const auto count = grid->activeVoxelCount();
    geometric_flow(*grid);
    EXPECT_EQ(grid->activeVoxelCount(), count);
    EXPECT_EQ(grid->tree().getValue(Coord(3, 3, 3)), 7.0f);
    EXPECT_EQ(grid->tree().getValue(Coord(20, 0, 0)), 5.0f);  // one active voxel has no neighbours
    EXPECT_EQ(grid->tree().getValue(Coord(4, 3, 3)), 1.0f);
}

TEST(GeometricFlow, NothingToDo) {
    auto empty = FloatGrid::create(1);
    const HyperdiffusionReport none = geometric_flow(*empty);
    EXPECT_EQ(none.active_voxels, 0u);
    EXPECT_EQ(none.steps, 0);
    auto grid = random_grid(9, 0.5);
    const auto before = grid->deepCopy();
    GeometricFlowOptions o;
    o.time = 0;
    EXPECT_EQ(geometric_flow(*grid, o).steps, 0);
    for (auto it = before->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, grid->tree().getValue(it.getCoord()));
}

TEST(GeometricFlow, AStepAboveTheBoundIsRefused) {
    auto grid = random_grid(10, 0.8);
    GeometricFlowOptions o;
    o.dt = 1.01 * Twin(*grid, o).bound();
    const auto before = grid->deepCopy();
    try {
        geometric_flow(*grid, o);
        FAIL() << "not refused";
    } catch (const InvalidInput& e) {
        EXPECT_NE(std::string(e.what()).find("bound"), std::string::npos) << e.what();
    }
    for (auto it = before->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, grid->tree().getValue(it.getCoord()));
}

TEST(GeometricFlow, BadOptionsAndValuesAreRefused) {
    const double nan = std::nan("");
    const auto refused = [](auto change) {
        auto grid = random_grid(11, 0.5);
        GeometricFlowOptions o;
        change(o);
        EXPECT_THROW(geometric_flow(*grid, o), InvalidInput);
    };
    refused([](auto& o) { o.order = 8; });
    refused([](auto& o) { o.order = -1; });
    refused([](auto& o) { o.time = -1; });
    refused([&](auto& o) { o.time = nan; });
    refused([](auto& o) { o.dt = 0; });
    refused([](auto& o) { o.fidelity = -1; });
    refused([&](auto& o) { o.pressure = nan; });
    refused([](auto& o) { o.scale = 0; });
    auto grid = random_grid(12, 0.5);
    grid->tree().setValue(Coord(-7, 25, 57), static_cast<float>(nan));
    EXPECT_THROW(geometric_flow(*grid), InvalidInput);
}

TEST(GeometricFlow, CancelledLeavesTheGrid) {
    auto grid = random_grid(13, 0.5);
    const auto before = grid->deepCopy();
    EXPECT_THROW(geometric_flow(*grid, {}, Progress([](double) { return false; })), Cancelled);
    for (auto it = before->cbeginValueOn(); it; ++it) ASSERT_EQ(*it, grid->tree().getValue(it.getCoord()));
}

}  // namespace
}  // namespace vdbgeo
