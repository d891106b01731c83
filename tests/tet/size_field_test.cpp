// Sizes of edges by curvature and by density.
#include "vdbgeo/tet/size_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

TriMesh with_curvature(TriMesh mesh, float k1, float k2) {
    mesh.vertex_properties.push_back({"k1", 1, std::vector<float>(mesh.points.size(), k1)});
    mesh.vertex_properties.push_back({"k2", 1, std::vector<float>(mesh.points.size(), k2)});
    return mesh;
}

CurvatureSizeOptions curvature_options(double min, double max, double edges = 12, double gradation = 0.5) {
    CurvatureSizeOptions o;
    o.min_A = min;
    o.max_A = max;
    o.edges_per_turn = edges;
    o.gradation = gradation;
    return o;
}

TEST(CurvatureSize, OfASphereGrowsWithTheDistance) {
    const TriMesh ball = with_curvature(test::icosphere(4, 20), -0.02f, 0.05f);
    const SizeField size = curvature_size(ball, curvature_options(0.5, 12, 12, 0.25));
    const double on_surface = 2 * M_PI / (12 * 0.05);
    for (const double r : {20.0, 17.0, 25.0}) {
        const Vec3d p = r * Vec3d(1, 2, -2) / 3;
        EXPECT_NEAR(size(p), on_surface + 0.25 * std::abs(r - 20), 0.25 * 0.05) << r;
    }
    EXPECT_EQ(size({400, 0, 0}), 12);
    EXPECT_EQ(curvature_size(ball, curvature_options(11, 12))({20, 0, 0}), 11);
}

/// One sharp vertex: the size next to it grows along the surface no faster than the gradation, and is the
/// largest that does not, by all shortest paths.
TEST(CurvatureSize, SpreadsAlongTheSurface) {
    TriMesh ball = with_curvature(test::icosphere(3, 10), 0.f, 0.f);
    const VertexId sharp = 17;
    ball.vertex_properties[1].values[sharp] = -20;
    const SizeField size = curvature_size(ball, curvature_options(0.1, 5, 12, 0.5));
    std::vector<double> expected(ball.points.size(), 5);
    expected[sharp] = 0.1;
    for (bool changed = true; changed;) {  // Bellman–Ford
        changed = false;
        for (const Triangle& t : ball.triangles)
            for (std::size_t k = 0; k < 3; ++k)
                for (const auto& [a, b] :
                     {std::pair(t[k], t[(k + 1) % 3]), std::pair(t[(k + 1) % 3], t[k])}) {
                    const double most = expected[a] + 0.5 * double((ball.points[a] - ball.points[b]).norm());
                    if (most < expected[b] - 1e-12) {
                        expected[b] = most;
                        changed = true;
                    }
                }
    }
    EXPECT_LT(*std::max_element(expected.begin(), expected.end()), 5.0 + 1e-12);
    EXPECT_GT(*std::max_element(expected.begin(), expected.end()), 4);
    for (std::size_t v = 0; v < expected.size(); ++v)
        EXPECT_NEAR(size(ball.points[v].cast<double>()), expected[v], 1e-6) << v;
}

TEST(CurvatureSize, NumbersThatAreNoneCountAsFlat) {
    TriMesh ball = with_curvature(test::icosphere(1, 10), 0.f, std::numeric_limits<float>::quiet_NaN());
    EXPECT_EQ(curvature_size(ball, curvature_options(1, 4))({0, 0, 10}), 4);
}

TEST(CurvatureSize, TheSameFromManyThreads) {
    const TriMesh ball = with_curvature(test::icosphere(3, 10), 0.1f, 0.3f);
    const SizeField size = curvature_size(ball, curvature_options(0.1, 5));
    std::vector<double> many(2000);
    const auto at = [](std::size_t i) { return Vec3d(double(i % 13), double(i % 7), double(i % 11)); };
    parallel_for(many.size(), 16, [&](std::size_t i) { many[i] = size(at(i)); });
    for (std::size_t i = 0; i < many.size(); ++i) EXPECT_EQ(many[i], size(at(i)));
}

TEST(CurvatureSize, RefusesBadInput) {
    const TriMesh ball = with_curvature(test::icosphere(1, 10), 0.1f, 0.1f);
    EXPECT_THROW(curvature_size(test::icosphere(1, 10), curvature_options(1, 4)), InvalidInput);
    EXPECT_THROW(curvature_size({}, curvature_options(1, 4)), InvalidInput);
    EXPECT_THROW(curvature_size(ball, curvature_options(0, 4)), InvalidInput);
    EXPECT_THROW(curvature_size(ball, curvature_options(5, 4)), InvalidInput);
    EXPECT_THROW(curvature_size(ball, curvature_options(1, 4, 0)), InvalidInput);
    EXPECT_THROW(curvature_size(ball, curvature_options(1, 4, 12, -1)), InvalidInput);
}

DensitySizeOptions density_options(double min, double max, double low, double high) {
    DensitySizeOptions o;
    o.min_A = min;
    o.max_A = max;
    o.low = low;
    o.high = high;
    return o;
}

/// The interpolant of a function that is linear along each axis is that function, in any frame.
TEST(DensitySize, IsTheTrilinearInterpolant) {
    Frame frame;
    frame.axes << 1.5, 0.3, 0.1, 0, 2, 0.4, 0.2, 0, 0.8;
    frame.origin = {-7, 3, 11};
    const Vec3i size(9, 12, 10);
    const Mat3d to_index = frame.axes.inverse();
    const auto density = [&](const Vec3d& world) {
        const Vec3d i = to_index * (world - frame.origin);
        return 0.5 + 0.3 * i.x() - 0.2 * i.y() * i.z() + 0.1 * i.x() * i.y() * i.z();
    };
    const DensityMap map = test::map_from_function(size, frame, density);
    const SizeField field = density_size(map, density_options(1, 1001, -1000, 1000));
    std::mt19937 random(5);
    std::uniform_real_distribution<double> part(0, 1);
    for (int i = 0; i < 1000; ++i) {
        const Vec3d index(8 * part(random), 11 * part(random), 9 * part(random));
        const Vec3d world = frame.to_world(index);
        EXPECT_NEAR(field(world), 501 - 0.5 * density(world), 2e-5);
    }
    const Vec3d beyond(20, 4.5, -3), nearest(8, 4.5, 0);
    EXPECT_NEAR(field(frame.to_world(beyond)), field(frame.to_world(nearest)), 1e-9);
}

TEST(DensitySize, IsConstantBeyondTheTwoDensities) {
    const DensityMap map = test::map_from_function(Vec3i::Constant(10), test::centred_frame(10, 1),
                                                   [](const Vec3d& p) { return p.x(); });
    const SizeField field = density_size(map, density_options(2, 6, -1, 3));
    for (const auto& [x, expected] : {std::pair(-3.0, 6.0), std::pair(-1.0, 6.0), std::pair(1.0, 4.0),
                                      std::pair(3.0, 2.0), std::pair(4.0, 2.0)})
        EXPECT_NEAR(field({x, 0.3, -0.2}), expected, 1e-6) << x;
}

TEST(DensitySize, SamplesThatAreNoNumberAreEmpty) {
    std::vector<float> values(27, 5);
    values[13] = std::numeric_limits<float>::quiet_NaN();
    const DensityMap map = test::map_from_values(Vec3i::Constant(3), values);
    const SizeField field = density_size(map, density_options(1, 9, 0, 5));
    EXPECT_EQ(field({1, 1, 1}), 9);
    EXPECT_EQ(field({1, 1, 1.25}), 9);
    EXPECT_EQ(field({0, 1, 1}), 1);
}

TEST(DensitySize, RefusesBadInput) {
    const DensityMap map = test::map_from_values(Vec3i::Constant(2), std::vector<float>(8, 1));
    EXPECT_THROW(density_size(map, density_options(0, 1, 0, 1)), InvalidInput);
    EXPECT_THROW(density_size(map, density_options(2, 1, 0, 1)), InvalidInput);
    EXPECT_THROW(density_size(map, density_options(1, 2, 1, 1)), InvalidInput);
    EXPECT_THROW(density_size(map, density_options(1, 2, 0, std::numeric_limits<double>::infinity())),
                 InvalidInput);
}

}  // namespace
}  // namespace vdbgeo
