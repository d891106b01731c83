#include "vdbgeo/flow/level_set_flow.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetMeasure.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>

#include "tests/flow/level_set_shapes.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::level_set_of;
using test::radii;
using test::sphere;
using test::torus;

LevelSetFlowOptions options(SurfaceFlow flow, double time) {
    LevelSetFlowOptions o;
    o.flow = flow;
    o.time = time;
    return o;
}

std::size_t components(const FloatGrid& grid) {
    std::vector<FloatGrid::Ptr> parts;
    openvdb::tools::segmentSDF(grid, parts);
    return parts.size();
}

void expect_same(const FloatGrid& a, const FloatGrid& b) {
    ASSERT_EQ(a.activeVoxelCount(), b.activeVoxelCount());
    for (auto it = a.cbeginValueOn(); it; ++it) ASSERT_EQ(*it, b.tree().getValue(it.getCoord()));
}

/// A level set as OpenVDB's tools want it, and distances.
void expect_level_set(const FloatGrid& grid) {
    const double voxel = grid.voxelSize()[0];
    const auto inside = openvdb::CoordBBox(openvdb::Coord(-40), openvdb::Coord(40));
    auto values = grid.getConstAccessor();
    for (auto it = grid.cbeginValueOn(); it; ++it) ASSERT_LT(std::abs(*it), grid.background());
    double worst = 0;
    for (auto c = inside.begin(); c; ++c) {
        const float v = values.getValue(*c);
        if (!values.isValueOn(*c)) {
            ASSERT_EQ(std::abs(v), grid.background()) << *c;
            continue;
        }
        if (std::abs(v) > voxel) continue;
        Vec3d g;
        for (int a = 0; a < 3; ++a) {
            openvdb::Coord next = *c, last = *c;
            ++next[a];
            --last[a];
            g[a] = (values.getValue(next) - values.getValue(last)) / 2 / voxel;
        }
        worst = std::max(worst, std::abs(g.length() - 1));
    }
    EXPECT_LT(worst, 0.05);
}

/// Relative error of the radius after half of a sphere's area is gone.
double shrunk_sphere_error(double radius) {
    auto grid = sphere(radius);
    const double time = radius * radius / 8;
    const LevelSetFlowReport report = level_set_flow(*grid, options(SurfaceFlow::mean_curvature, time));
    EXPECT_NEAR(report.volume_before, 4.0 / 3 * M_PI * std::pow(radius, 3), 2e-3 * report.volume_before);
    EXPECT_NEAR(report.volume_after, openvdb::tools::levelSetVolume(*grid), 0.02 * report.volume_after);
    EXPECT_NEAR(report.time, time, 1e-9 * time);
    EXPECT_EQ(report.active_voxels, grid->activeVoxelCount());
    EXPECT_FALSE(report.vanished);
    const double expected = std::sqrt(radius * radius - 4 * time);
    EXPECT_LT(std::abs(radii(*grid).least / expected - 1), 0.01);
    EXPECT_LT(std::abs(radii(*grid).most / expected - 1), 0.01);
    expect_level_set(*grid);
    return std::abs(std::cbrt(report.volume_after * 3 / (4 * M_PI)) / expected - 1);
}

TEST(MeanCurvatureFlow, SpheresShrinkAsTheyShouldAndConverge) {
    const double coarse = shrunk_sphere_error(8), fine = shrunk_sphere_error(16);
    EXPECT_LT(coarse, 3e-3);
    EXPECT_LT(fine, 1e-3);
    EXPECT_GT(std::log2(coarse / fine), 1.5);  // second order
}

TEST(MeanCurvatureFlow, ASphereVanishes) {
    auto grid = sphere(4);
    const LevelSetFlowReport report = level_set_flow(*grid, options(SurfaceFlow::mean_curvature, 10));
    EXPECT_TRUE(report.vanished);
    EXPECT_NEAR(report.time, 4, 0.9);
    EXPECT_EQ(report.volume_after, 0);
    EXPECT_EQ(grid->activeVoxelCount(), 0u);
    EXPECT_EQ(grid->background(), 3.0f);
    EXPECT_EQ(grid->tree().getValue(openvdb::Coord(0)), 3.0f);
    EXPECT_TRUE(level_set_flow(*grid).vanished);
}

TEST(MeanCurvatureFlow, ADumbbellSplitsAndTheSmallerHalfVanishes) {
    auto grid = level_set_of(28, [](const Vec3d& p) {
        const double left = (p - Vec3d(-12, 0, 0)).length() - 5, right = (p - Vec3d(12, 0, 0)).length() - 8;
        const double rod = std::max(std::hypot(p[1], p[2]) - 2.5, std::abs(p[0]) - 12);
        return std::min({left, right, rod});
    });
    EXPECT_EQ(components(*grid), 1u);
    level_set_flow(*grid, options(SurfaceFlow::mean_curvature, 4.5));
    EXPECT_EQ(components(*grid), 2u);
    const LevelSetFlowReport report = level_set_flow(*grid, options(SurfaceFlow::mean_curvature, 4));
    EXPECT_EQ(components(*grid), 1u);
    EXPECT_FALSE(report.vanished);
}

TEST(MeanCurvatureFlow, TheHoleOfAThickTorusCloses) {
    auto grid = torus(9, 7);
    const openvdb::Coord centre(0, 0, 0);
    EXPECT_GT(grid->tree().getValue(centre), 0);
    level_set_flow(*grid, options(SurfaceFlow::mean_curvature, 6));
    EXPECT_LT(grid->tree().getValue(centre), 0);
    EXPECT_EQ(components(*grid), 1u);
}

TEST(MeanCurvatureFlow, TwoBallsThatTouchBecomeOne) {
    const auto two = [](const Vec3d& p) {
        return std::min((p - Vec3d(-7.6, 0, 0)).length(), (p - Vec3d(7.6, 0, 0)).length()) - 8;
    };
    auto grid = level_set_of(22, two);
    const double neck_before = std::sqrt(64 - 7.6 * 7.6);
    const LevelSetFlowReport report = level_set_flow(*grid, options(SurfaceFlow::surface_diffusion, 30));
    EXPECT_EQ(components(*grid), 1u);
    double neck = 0;
    test::for_crossings(*grid, [&](const Vec3d& p) {
        if (std::abs(p[0]) < 0.6) neck = std::max(neck, std::hypot(p[1], p[2]));
    });
    EXPECT_GT(neck, neck_before + 1);
    EXPECT_NEAR(report.volume_after, report.volume_before, 0.005 * report.volume_before);
}

class FourthOrder : public testing::TestWithParam<SurfaceFlow> {};

TEST_P(FourthOrder, SpheresAreStationary) {
    auto grid = sphere(10);
    const LevelSetFlowReport report = level_set_flow(*grid, options(GetParam(), 1000));
    EXPECT_NEAR(report.volume_after, report.volume_before, 0.005 * report.volume_before);
    EXPECT_GT(radii(*grid).least, 9.95);
    EXPECT_LT(radii(*grid).most, 10.05);
    expect_level_set(*grid);
}

INSTANTIATE_TEST_SUITE_P(Flows, FourthOrder,
                         testing::Values(SurfaceFlow::surface_diffusion, SurfaceFlow::willmore));

TEST(SurfaceDiffusion, APerturbedSphereBecomesRoundAndKeepsItsVolume) {
    auto grid = level_set_of(17, [](const Vec3d& p) {
        const double r = p.length() + 1e-9, c = p[2] / r;
        return r - 10 * (1 + 0.075 * (3 * c * c - 1) + 0.04 * (p[0] * p[1] * p[2]) / (r * r * r));
    });
    const double spread = radii(*grid).spread(), volume = openvdb::tools::levelSetVolume(*grid);
    const LevelSetFlowReport report = level_set_flow(*grid, options(SurfaceFlow::surface_diffusion, 1000));
    EXPECT_GT(spread, 2);
    EXPECT_LT(radii(*grid).spread(), 0.25 * spread);
    EXPECT_NEAR(report.volume_after, report.volume_before, 0.005 * report.volume_before);
    EXPECT_NEAR(openvdb::tools::levelSetVolume(*grid), volume, 0.01 * volume);
}

TEST(SurfaceDiffusion, ASmallWaveDecaysAtItsRate) {
    // The second harmonic: (l−1) l (l+1) (l+2) / R⁴ with l = 2.
    const double radius = 9, time = 200;
    auto grid = level_set_of(14, [&](const Vec3d& p) {
        const double r = p.length() + 1e-9, c = p[2] / r;
        return r - radius - 0.25 * (3 * c * c - 1);
    });
    const double spread = radii(*grid).spread();
    auto o = options(SurfaceFlow::surface_diffusion, time);
    o.dt = 20;
    level_set_flow(*grid, o);
    const double expected = std::exp(-24 / std::pow(radius, 4) * time);
    EXPECT_NEAR(radii(*grid).spread() / spread, expected, 0.15 * expected);
}

double ratio(const FloatGrid& grid) {
    double outer = 0, inner = 1e30;
    test::for_crossings(grid, [&](const Vec3d& p) {
        outer = std::max(outer, std::hypot(p[0], p[1]));
        inner = std::min(inner, std::hypot(p[0], p[1]));
    });
    return (outer + inner) / (outer - inner);
}

TEST(Willmore, ATorusOfRatioTwoMovesTowardTheRootOfTwo) {
    auto grid = torus(14, 7);
    double last = ratio(*grid);
    EXPECT_NEAR(last, 2, 0.02);
    for (int i = 0; i < 3; ++i) {
        level_set_flow(*grid, options(SurfaceFlow::willmore, 300));
        const double now = ratio(*grid);
        EXPECT_LT(now, last - 0.05) << i;
        last = now;
    }
    EXPECT_LT(last, 1.75);
    EXPECT_GT(last, std::sqrt(2.0));
}

TEST(LevelSetFlow, TimeIsInVoxelsWhateverTheirSize) {
    auto unit = sphere(8), small = sphere(8, 3, 0.25);
    const auto o = options(SurfaceFlow::mean_curvature, 2);
    const LevelSetFlowReport a = level_set_flow(*unit, o), b = level_set_flow(*small, o);
    EXPECT_EQ(a.steps, b.steps);
    EXPECT_NEAR(a.volume_after, b.volume_after, 1e-3);
    for (auto it = unit->cbeginValueOn(); it; ++it)
        ASSERT_NEAR(small->tree().getValue(it.getCoord()), 0.25 * *it, 1e-4);
    EXPECT_EQ(small->background(), 0.75f);
    EXPECT_EQ(small->voxelSize()[0], 0.25);
}

TEST(LevelSetFlow, TheSameBitsForAnyNumberOfThreads) {
    for (const SurfaceFlow flow : {SurfaceFlow::mean_curvature, SurfaceFlow::surface_diffusion}) {
        std::array<FloatGrid::Ptr, 2> grids;
        for (std::size_t i = 0; i < 2; ++i) {
            const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, i == 0 ? 1 : 4);
            grids[i] = torus(12, 6);
            level_set_flow(*grids[i], options(flow, 1));
        }
        expect_same(*grids[0], *grids[1]);
    }
}

TEST(LevelSetFlow, TheBandHasTheWidthAskedFor) {
    auto grid = sphere(9);
    auto o = options(SurfaceFlow::mean_curvature, 0.5);
    o.half_width = 5;
    level_set_flow(*grid, o);
    EXPECT_EQ(grid->background(), 5.0f);
    for (auto it = grid->cbeginValueOn(); it; ++it)
        ASSERT_NEAR(*it, (it.getCoord().asVec3d() - test::middle).length() - std::sqrt(81 - 2.0), 0.02);
    EXPECT_EQ(grid->tree().getValue(openvdb::Coord(0)), -5.0f);
}

TEST(LevelSetFlow, NothingToDo) {
    auto grid = sphere(8);
    const auto before = grid->deepCopy();
    const LevelSetFlowReport report = level_set_flow(*grid, options(SurfaceFlow::willmore, 0));
    EXPECT_EQ(report.steps, 0);
    EXPECT_EQ(report.volume_before, report.volume_after);
    expect_same(*before, *grid);
}

TEST(LevelSetFlow, WhatItDoesNotTakeIsRefused) {
    const auto refused = [](const FloatGrid::Ptr& grid, const LevelSetFlowOptions& o,
                            const std::string& word) {
        const auto before = grid->deepCopy();
        try {
            level_set_flow(*grid, o);
            FAIL() << "not refused: " << word;
        } catch (const InvalidInput& e) {
            EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
        }
        EXPECT_EQ(grid->activeVoxelCount(), before->activeVoxelCount());
    };
    const auto plain = options(SurfaceFlow::mean_curvature, 1);
    auto fog = sphere(5);
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    refused(fog, plain, "class");
    auto flat = sphere(5);
    auto transform = openvdb::math::Transform::createLinearTransform(1);
    transform->preScale(Vec3d(1, 1, 2));
    flat->setTransform(transform);
    refused(flat, plain, "cubic");
    auto broken = sphere(5);
    broken->tree().setValue(openvdb::Coord(5, 0, 0), std::nanf(""));
    refused(broken, plain, "not finite");
    auto o = plain;
    o.dt = 0.17;
    refused(sphere(5), o, "bound");
    o.dt = -1;
    refused(sphere(5), o, "step");
    o = plain;
    o.time = -1;
    refused(sphere(5), o, "time");
    o = plain;
    o.half_width = 1;
    refused(sphere(5), o, "band");
}

TEST(LevelSetFlow, AStepThatGoesTooFarIsAnError) {
    auto grid = level_set_of(12, [](const Vec3d& p) {
        return std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])}) - 7;  // a cube has sharp edges
    });
    auto o = options(SurfaceFlow::surface_diffusion, 1e6);
    o.dt = 1e5;
    const auto before = grid->deepCopy();
    EXPECT_THROW(level_set_flow(*grid, o), NumericalError);
    expect_same(*before, *grid);
}

TEST(LevelSetFlow, CancelledLeavesTheGrid) {
    auto grid = sphere(8);
    const auto before = grid->deepCopy();
    EXPECT_THROW(level_set_flow(*grid, {}, Progress([](double) { return false; })), Cancelled);
    expect_same(*before, *grid);
}

}  // namespace
}  // namespace vdbgeo
