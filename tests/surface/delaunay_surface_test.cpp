#include "vdbgeo/surface/delaunay_surface.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>

#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/trilinear_field.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::map_from_function;

class DelaunaySurface : public testing::Test {
 protected:
    void SetUp() override {
        openvdb::initialize();
        if (!have_delaunay()) GTEST_SKIP() << "this build has no CGAL";
    }
};

DelaunaySurfaceOptions at(double isovalue) {
    DelaunaySurfaceOptions options;
    options.isovalue = isovalue;
    return options;
}

/// What every result promises.
void expect_sound(const TriMesh& mesh) {
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed);
    EXPECT_TRUE(m.oriented);
    EXPECT_TRUE(m.manifold);
    EXPECT_EQ(m.unused_vertices, 0u);
    EXPECT_GE(m.min_angle_deg, 30 - 1e-3);
    EXPECT_TRUE(self_intersections(mesh).empty());
}

double sphere(const Vec3d& p, const Vec3d& centre, double radius) { return radius - (p - centre).norm(); }

TEST(TrilinearField, TellsTheSamplesAndTheirMixtures) {
    openvdb::initialize();
    const Vec3i size(19, 21, 17);
    const std::vector<float> v = test::noise(19 * 21 * 17, 5);
    const DensityMap map = test::map_from_values(size, v);
    const TrilinearField field(map, 0.25);
    const auto sample = [&](int x, int y, int z) {
        return static_cast<double>(v[static_cast<std::size_t>(x + 19 * (y + 21 * z))]);
    };
    const std::vector<float> where = test::noise(3000, 6);
    for (std::size_t i = 0; i < 3000; i += 3) {
        Vec3d p;
        double expected = 0;
        for (int a = 0; a < 3; ++a)
            p[a] = 0.5 * (static_cast<double>(where[i + static_cast<std::size_t>(a)]) + 1) * (size[a] - 1);
        for (int k = 0; k < 8; ++k) {
            double weight = 1;
            Vec3i c;
            for (int a = 0; a < 3; ++a) {
                const int base = std::min(static_cast<int>(p[a]), size[a] - 2), up = k >> a & 1;
                c[a] = base + up;
                weight *= up ? p[a] - base : 1 - (p[a] - base);
            }
            expected += weight * sample(c.x(), c.y(), c.z());
        }
        ASSERT_NEAR(field(p), expected - 0.25, 1e-12);
    }
    for (int axis = 0; axis < 3; ++axis) {
        Vec3d p(5, 5, 5);
        p[axis] = -1e-9;
        EXPECT_TRUE(std::isinf(field(p)));
        p[axis] = size[axis] - 1 + 1e-9;
        EXPECT_TRUE(std::isinf(field(p)));
        p[axis] = size[axis] - 1;
        EXPECT_TRUE(std::isfinite(field(p)));
    }
}

TEST(TrilinearField, AnUnboundedGridGoesOnAsBackground) {
    openvdb::initialize();
    auto grid = openvdb::FloatGrid::create(-2);
    grid->tree().setValue(openvdb::Coord(-1, 0, 200), 4);
    grid->tree().addTile(1, openvdb::Coord(64, 0, 0), 3, true);
    DensityMap map;
    map.grid = grid;
    const TrilinearField field(map, 1);
    EXPECT_EQ(field(Vec3d(-1, 0, 200)), 3);
    EXPECT_EQ(field(Vec3d(-0.5, 0, 200)), 0);
    EXPECT_EQ(field(Vec3d(-1.75, 0, 200)), -1.5);
    EXPECT_EQ(field(Vec3d(66, 3, 3)), 2);
    EXPECT_EQ(field(Vec3d(1e5, 1e5, -1e5)), -3);
    EXPECT_EQ(field(Vec3d(1e200, 0, 0)), -3);
}

TEST(TrilinearField, ASampleThatIsNoNumberIsEmpty) {
    openvdb::initialize();
    const DensityMap map = map_from_function(
        {4, 4, 4}, {}, [](const Vec3d& p) { return p == Vec3d(1, 1, 1) ? std::nan("") : 1.0; });
    const TrilinearField field(map, 0.5);
    EXPECT_LT(field(Vec3d(1, 1, 1)), 0);
    EXPECT_LT(field(Vec3d(1.5, 1, 1)), 0);
    EXPECT_GT(field(Vec3d(2, 1, 1)), 0);
    EXPECT_GT(field(Vec3d(2.5, 1, 1)), 0);
}

TEST_F(DelaunaySurface, Sphere) {
    const double r = 20;
    const DensityMap map = map_from_function({48, 48, 48}, centred_frame(48, 1.5), [&](const Vec3d& p) {
        return sphere(p, Vec3d(0.3, -0.2, 0.1), r);
    });
    const TriMesh mesh = delaunay_surface(map, at(0));
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(m.area_A2, 4 * M_PI * r * r, 0.01 * 4 * M_PI * r * r);
    ASSERT_TRUE(m.volume_A3);
    EXPECT_NEAR(*m.volume_A3, 4 * M_PI / 3 * r * r * r, 0.01 * 4 * M_PI / 3 * r * r * r);
    for (const Vec3f& p : mesh.points)
        ASSERT_NEAR((p.cast<double>() - Vec3d(0.3, -0.2, 0.1)).norm(), r, 0.05);
}

TEST_F(DelaunaySurface, TorusInASkewedFrame) {
    Frame frame;
    frame.axes << 1, 0.3, 0, 0, 1.2, 0.1, 0, 0, 0.8;
    frame.origin = -frame.axes * Vec3d(30, 25, 15);
    const DensityMap map = map_from_function({61, 51, 31}, frame, [](const Vec3d& p) {
        return 4 - std::hypot(std::hypot(p.x(), p.y()) - 12, p.z());
    });
    const TriMesh mesh = delaunay_surface(map, at(0));
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.genus, 1);
    EXPECT_NEAR(*m.volume_A3, 2 * M_PI * M_PI * 12 * 16, 0.03 * 2 * M_PI * M_PI * 12 * 16);
}

TEST_F(DelaunaySurface, AMirroredFrameTurnsNothing) {
    Frame frame = centred_frame(24, 1);
    frame.axes.col(0) *= -1;
    frame.origin.x() *= -1;
    const DensityMap map =
        map_from_function({24, 24, 24}, frame, [](const Vec3d& p) { return sphere(p, Vec3d::Zero(), 8); });
    EXPECT_GT(measure_mesh(delaunay_surface(map, at(0))).volume_A3.value_or(-1), 2000);
}

TEST_F(DelaunaySurface, ATinySphereBesideALargeOne) {
    const DensityMap map = map_from_function({50, 40, 40}, {}, [](const Vec3d& p) {
        return std::max(sphere(p, Vec3d(16, 20, 20), 13), sphere(p, Vec3d(41.4, 20.3, 19.8), 1.2));
    });
    DelaunaySurfaceOptions options = at(0);
    options.radius = options.distance = 2.5;
    const TriMesh mesh = delaunay_surface(map, options);
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.components, 2u);
    double small = 0;
    for (const Triangle& t : mesh.triangles)
        if (mesh.points[t[0]].x() > 35)
            small += mesh.points[t[0]].cast<double>().dot(
                         mesh.points[t[1]].cast<double>().cross(mesh.points[t[2]].cast<double>())) /
                     6;
    // The trilinear interpolant of such a small sphere is smaller than it.
    EXPECT_GT(small, 3);
    EXPECT_LT(small, 7.3);
}

TEST_F(DelaunaySurface, ACavityIsTurnedInward) {
    const DensityMap map = map_from_function({40, 40, 40}, centred_frame(40, 1),
                                             [](const Vec3d& p) { return 5 - std::abs(p.norm() - 11); });
    const TriMesh mesh = delaunay_surface(map, at(0));
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.components, 2u);
    const double shell = 4 * M_PI / 3 * (16 * 16 * 16 - 6 * 6 * 6);
    EXPECT_NEAR(*m.volume_A3, shell, 0.02 * shell);
}

TEST_F(DelaunaySurface, IsClosedAtTheBorderOfTheBox) {
    // Half a sphere, cut off by the plane z = 0.
    const DensityMap map = map_from_function(
        {40, 40, 20}, {}, [](const Vec3d& p) { return sphere(p, Vec3d(19.6, 19.3, 0), 12); });
    const TriMesh mesh = delaunay_surface(map, at(0));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_EQ(m.components, 1u);
    EXPECT_NEAR(*m.volume_A3, 2 * M_PI / 3 * 1728, 0.03 * 2 * M_PI / 3 * 1728);
}

TEST_F(DelaunaySurface, AMapThatIsInsideAllOverIsItsBox) {
    const DensityMap map = map_from_function({12, 10, 14}, {}, [](const Vec3d&) { return 1.0; });
    const MeshMeasures m = measure_mesh(delaunay_surface(map, at(0.5)));
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3, 11 * 9 * 13, 0.05 * 11 * 9 * 13);
}

TEST_F(DelaunaySurface, OneVoxel) {
    for (const double isovalue : {0.02, 0.5, 0.98, 1.0}) {
        const DensityMap map =
            map_from_function({9, 9, 9}, {}, [](const Vec3d& p) { return p == Vec3d(4, 4, 4) ? 1.0 : 0.0; });
        const MeshMeasures m = measure_mesh(delaunay_surface(map, at(isovalue)));
        EXPECT_TRUE(m.closed && m.oriented && m.manifold) << isovalue;
        EXPECT_EQ(m.components, 1u);
        EXPECT_EQ(m.genus, 0);
        EXPECT_GT(*m.volume_A3, 0);
    }
}

TEST_F(DelaunaySurface, ABackgroundThatIsInside) {
    auto grid = openvdb::FloatGrid::create(1);
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-9), openvdb::Coord(9)).begin(); c; ++c)
        grid->tree().setValue(*c, static_cast<float>((*c).asVec3d().length() - 6));
    DensityMap map;
    map.grid = grid;
    map.statistics.min = -6;
    const TriMesh mesh = delaunay_surface(map, at(0));
    expect_sound(mesh);
    EXPECT_NEAR(*measure_mesh(mesh).volume_A3, -4 * M_PI / 3 * 216, 0.05 * 4 * M_PI / 3 * 216);
}

TEST_F(DelaunaySurface, NothingToMeshIsAnEmptyMesh) {
    const DensityMap map = map_from_function({9, 9, 9}, {}, [](const Vec3d&) { return 0.0; });
    EXPECT_TRUE(delaunay_surface(map, at(0.5)).empty());
}

TEST_F(DelaunaySurface, HasAllComponentsOfMarchingCubesInNoise) {
    auto map = test::map_from_values({12, 12, 12}, test::noise(1728, 11));
    map.frame.size.setZero();  // nothing outside, as the border's closure wants it
    const MeshMeasures m = measure_mesh(delaunay_surface(map, at(0.8)));
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    MarchingCubesOptions cubes;
    cubes.isovalue = 0.8;
    const MeshMeasures reference = measure_mesh(marching_cubes(map, cubes));
    EXPECT_GT(reference.components, 50u);
    // Voxels that touch through a neck of a hundredth of a voxel may be parted.
    EXPECT_GE(m.components, reference.components);
    EXPECT_LE(m.components, reference.components + reference.components / 10);
    EXPECT_GT(*m.volume_A3, 0);
}

TEST_F(DelaunaySurface, HasTheComponentsOfMarchingCubes) {
    // Forty blobs of 0.6 to 3 voxels at random, some of which touch.
    std::vector<float> random = test::noise(200, 3);
    const DensityMap map = map_from_function({40, 40, 40}, {}, [&](const Vec3d& p) {
        double value = 0;
        for (std::size_t i = 0; i < 200; i += 5) {
            const Vec3d at(20 + 15 * static_cast<double>(random[i]),
                           20 + 15 * static_cast<double>(random[i + 1]),
                           20 + 15 * static_cast<double>(random[i + 2]));
            const double width = 1.8 + 1.2 * static_cast<double>(random[i + 3]);
            value += std::exp(-(p - at).squaredNorm() / (width * width));
        }
        return value;
    });
    const TriMesh mesh = delaunay_surface(map, at(0.4));
    expect_sound(mesh);
    MarchingCubesOptions cubes;
    cubes.isovalue = 0.4;
    const MeshMeasures m = measure_mesh(mesh), reference = measure_mesh(marching_cubes(map, cubes));
    EXPECT_GT(reference.components, 10u);
    EXPECT_EQ(m.components, reference.components);
    EXPECT_NEAR(*m.volume_A3, *reference.volume_A3, 0.05 * *reference.volume_A3);
}

TEST_F(DelaunaySurface, TheSameBytesAgainAndForAnyThreads) {
    const DensityMap map = map_from_function({30, 30, 30}, centred_frame(30, 2), [](const Vec3d& p) {
        return std::sin(p.x() / 5) + std::sin(p.y() / 6) + std::sin(p.z() / 7);
    });
    TriMesh first, second;
    test::with_threads(1, [&] { first = delaunay_surface(map, at(0.7)); });
    test::with_threads(2, [&] { second = delaunay_surface(map, at(0.7)); });
    ASSERT_FALSE(first.empty());
    ASSERT_EQ(first.points.size(), second.points.size());
    EXPECT_EQ(0, std::memcmp(first.points.data(), second.points.data(), first.points.size() * sizeof(Vec3f)));
    EXPECT_EQ(first.triangles, second.triangles);
}

TEST_F(DelaunaySurface, CapsEndIt) {
    const DensityMap map = map_from_function({40, 40, 40}, centred_frame(40, 1),
                                             [](const Vec3d& p) { return sphere(p, Vec3d::Zero(), 15); });
    DelaunaySurfaceOptions few = at(0);
    few.max_vertices = 500;
    try {
        delaunay_surface(map, few);
        FAIL();
    } catch (const NumericalError& e) {
        EXPECT_NE(std::string(e.what()).find("500 vertices"), std::string::npos) << e.what();
    }
    DelaunaySurfaceOptions soon = at(0);
    soon.radius = 0.05;
    soon.max_seconds = 0.01;
    try {
        delaunay_surface(map, soon);
        FAIL();
    } catch (const NumericalError& e) {
        EXPECT_NE(std::string(e.what()).find("0.01 s"), std::string::npos) << e.what();
    }
}

TEST_F(DelaunaySurface, CanBeCancelled) {
    const DensityMap map = map_from_function({40, 40, 40}, centred_frame(40, 1),
                                             [](const Vec3d& p) { return sphere(p, Vec3d::Zero(), 15); });
    std::atomic<int> reports{0};
    const Progress stop([&](double fraction) {
        ++reports;
        return fraction < 0.3;
    });
    EXPECT_THROW(delaunay_surface(map, at(0), stop), Cancelled);
    EXPECT_GT(reports, 3);
}

TEST_F(DelaunaySurface, RefusesBadOptions) {
    const DensityMap map = map_from_function({5, 5, 5}, {}, [](const Vec3d&) { return 0.0; });
    const auto refused = [&](auto change) {
        DelaunaySurfaceOptions options;
        change(options);
        EXPECT_THROW(delaunay_surface(map, options), InvalidInput);
    };
    refused([](auto& o) { o.isovalue = std::nan(""); });
    refused([](auto& o) { o.angle_deg = 31; });
    refused([](auto& o) { o.angle_deg = -1; });
    refused([](auto& o) { o.radius = 0; });
    refused([](auto& o) { o.distance = std::nan(""); });
    refused([](auto& o) { o.max_vertices = 0; });
    refused([](auto& o) { o.max_seconds = 0; });
}

}  // namespace
}  // namespace vdbgeo
