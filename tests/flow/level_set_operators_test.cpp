#include "vdbgeo/flow/level_set_operators.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "tests/flow/level_set_shapes.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;
using stencil::BlockField;

/// body(index of the float, position from the middle) for the active voxels of the band.
template <class Body>
void for_voxels(const stencil::BlockLayout& layout, const Body& body) {
    for (std::size_t b = 0; b < layout.brick_count(); ++b)
        for (int i = 0; i < 512; ++i)
            if (layout.mask(b)[static_cast<std::size_t>(i >> 6)] >> (i & 63) & 1)
                body(b * 512 + static_cast<std::size_t>(i),
                     layout.origin(b).offsetBy(i >> 6, i >> 3 & 7, i & 7));
}

TEST(Interpolation, PolynomialsAreExact) {
    const int n = 12;
    std::vector<float> data(n * n * n);
    const auto f = [](double x, double y, double z) {
        return 1 + x * y * z / 50 - x * x * z / 30 + y * y * y / 100;
    };
    for (int i = 0; i < n * n * n; ++i)
        data[static_cast<std::size_t>(i)] = static_cast<float>(f(i / (n * n), i / n % n, i % n));
    const DenseWindow window{data.data(), n * n, n, {0, 0, 0}, {n - 1, n - 1, n - 1}};
    const Vec3d p(4.3, 5.9, 6.05);
    const vdbgeo::Vec3d at(p[0], p[1], p[2]);
    for (const ValueAndGradient& v : {lagrange<4>(window, at), lagrange<6>(window, at)}) {
        EXPECT_NEAR(v.value, f(p[0], p[1], p[2]), 1e-5);
        EXPECT_NEAR(v.gradient[0], p[1] * p[2] / 50 - 2 * p[0] * p[2] / 30, 1e-5);
        EXPECT_NEAR(v.gradient[1], p[0] * p[2] / 50 + 3 * p[1] * p[1] / 100, 1e-5);
        EXPECT_NEAR(v.gradient[2], p[0] * p[1] / 50 - p[0] * p[0] / 30, 1e-5);
    }
    EXPECT_TRUE(std::isnan(lagrange<6>(window, vdbgeo::Vec3d(1.5, 5, 5)).value));
    EXPECT_TRUE(std::isfinite(smooth_value(window, vdbgeo::Vec3d(1.5, 5, 5)).value));
    data[static_cast<std::size_t>((4 * n + 5) * n + 6)] = not_a_value;
    EXPECT_TRUE(std::isnan(smooth_value(window, at).value));
    EXPECT_NEAR(interpolate(window, at), f(p[0], p[1], p[2]), 1);
}

/// Largest |φ − exact| within 3 voxels after some rebuilds.
double distance_error(SurfaceBand& band, double radius) {
    double worst = 0;
    for_voxels(band.layout(), [&](std::size_t i, const Coord& c) {
        const double exact = (c.asVec3d() - test::middle).length() - radius;
        if (std::abs(exact) < 3) worst = std::max(worst, std::abs(band.phi()[i] - exact));
    });
    return worst;
}

TEST(SurfaceBand, RebuildingDoesNotMoveTheZeroLevel) {
    // The error of an interpolant of order 6, and less for a larger radius.
    SurfaceBand small(*test::sphere(10, 8), 6), large(*test::sphere(20, 8), 6);
    for (int i = 0; i < 20; ++i) {
        small.rebuild();
        large.rebuild();
    }
    EXPECT_LT(distance_error(small, 10), 2e-4);
    EXPECT_LT(distance_error(large, 20), 5e-6);
    EXPECT_NEAR(small.measures().volume / (4.0 / 3 * M_PI * 1000), 1, 2e-4);
    EXPECT_NEAR(large.measures().area / (4 * M_PI * 400), 1, 2e-4);
}

TEST(SurfaceBand, ANarrowBandIsWidened) {
    SurfaceBand band(*test::sphere(12, 3), 6);
    EXPECT_LT(distance_error(band, 12), 2e-3);
    double farthest = 0;
    for_voxels(band.layout(), [&](std::size_t i, const Coord& c) {
        const double exact = (c.asVec3d() - test::middle).length() - 12;
        farthest = std::max(farthest, exact);
        if (std::abs(exact) < 5.5) {
            ASSERT_NEAR(band.phi()[i], exact, 0.02);
        }
    });
    EXPECT_GT(farthest, 6);
}

TEST(SurfaceBand, DistancesAreMadeOfAFieldThatIsNotOne) {
    SurfaceBand band(*test::sphere(12, 8), 6);
    for_voxels(band.layout(), [&](std::size_t i, const Coord& c) {
        band.phi()[i] *= 1.4f + 0.3f * static_cast<float>(std::sin(0.3 * c.x()));
    });
    band.rebuild();
    EXPECT_LT(distance_error(band, 12), 5e-3);
}

TEST(LevelSetOperators, SpeedsOfATorusAreTheAnalyticOnes) {
    const double big = 24, tube = 12;
    SurfaceBand band(*test::torus(big, tube, 8), 6);
    const BlockField rate = mean_curvature_rate(band), diffusion = surface_diffusion_speed(band),
                     willmore = willmore_speed(band);
    double scale = 0, worst_diffusion = 0, worst_willmore = 0;
    for_voxels(band.layout(), [&](std::size_t i, const Coord& c) {
        const Vec3d p = c.asVec3d() - test::middle;
        const double q = std::hypot(p[0], p[1]) - big, d = std::hypot(q, p[2]), cosine = q / d;
        if (std::abs(d - tube) > 3) return;
        const double here = big + d * cosine;  // mean curvature is that of the voxel's own level
        ASSERT_NEAR(rate.brick(0)[i], 1 / d + cosine / here, 0.01 * (1 / d));
        const double w = big + tube * cosine, k1 = 1 / tube, k2 = cosine / w;
        const double laplacian =
            -big * (cosine * w + tube * (1 - cosine * cosine)) / (2 * tube * tube * w * w * w);
        const double h = (k1 + k2) / 2, v = laplacian + 2 * h * (h * h - k1 * k2);
        scale = std::max(scale, std::abs(laplacian));
        worst_diffusion = std::max(worst_diffusion, std::abs(diffusion.brick(0)[i] - 2 * laplacian) / 2);
        worst_willmore = std::max(worst_willmore, std::abs(willmore.brick(0)[i] - v));
    });
    EXPECT_LT(worst_diffusion, 0.1 * scale);
    EXPECT_LT(worst_willmore, 0.1 * scale);
}

TEST(LevelSetOperators, TheImplicitStepSolvesItsEquation) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> value(-1, 1);
    openvdb::FloatTree tree(0);
    for (int x = -9; x < 9; ++x)
        for (int y = 24; y < 40; ++y)
            for (int z = 56; z < 70; ++z)
                if (value(random) < 0.3f) tree.setValueOn(Coord(x, y, z), value(random));
    const stencil::BlockLayout layout(tree);
    BlockField right(layout.brick_count()), delta;
    stencil::load(layout, tree, 0, right.brick(0));
    const double a = 3;
    EXPECT_GT(solve_biharmonic(layout, a, right, 1e-5, 0, delta), 3);
    std::map<Coord, double> u, once;
    for_voxels(layout, [&](std::size_t i, const Coord& c) { u[c] = delta.brick(0)[i]; });
    const auto negative_laplacian = [](const std::map<Coord, double>& f, const Coord& c) {
        double sum = 0;
        for (int d = 0; d < 6; ++d) {
            Coord n = c;
            n[d / 2] += d % 2 ? 1 : -1;
            const auto it = f.find(n);
            if (it != f.end()) sum += f.at(c) - it->second;
        }
        return sum;
    };
    for (const auto& [c, v] : u) once[c] = negative_laplacian(u, c);
    double residual = 0, norm = 0;
    for_voxels(layout, [&](std::size_t i, const Coord& c) {
        const double b = right.brick(0)[i];
        residual += std::pow(u[c] + a * negative_laplacian(once, c) - b, 2);
        norm += b * b;
    });
    EXPECT_LT(std::sqrt(residual / norm), 3e-5);
}

}  // namespace
}  // namespace vdbgeo
