#include "vdbgeo/remesh/delaunay_remesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/surface/delaunay_surface.h"
#include "vdbgeo/surface/mesh_solid.h"

namespace vdbgeo {
namespace {

class DelaunayRemesh : public testing::Test {
 protected:
    void SetUp() override {
        if (!have_delaunay()) GTEST_SKIP() << "this build has no CGAL";
    }
};

DelaunayRemeshOptions bound(double radius) {
    DelaunayRemeshOptions options;
    options.radius = options.distance = radius;
    return options;
}

void expect_sound(const TriMesh& mesh) {
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_GE(m.min_angle_deg, 30 - 1e-3);
    EXPECT_TRUE(self_intersections(mesh).empty());
}

TEST(MeshSolid, KnowsInsideFromOutside) {
    const TriMesh mesh = test::joined(test::icosphere(3, 10), test::flipped(test::icosphere(2, 4)));
    std::vector<Vec3d> points;
    for (const Vec3f& p : mesh.points) points.push_back(p.cast<double>());
    const MeshSolid solid(points, mesh.triangles);
    for (double x = -11; x <= 11; x += 0.5)  // through vertices and along edges too
        for (double y = -11; y <= 11; y += 0.5)
            for (double z = -11; z <= 11; z += 0.5) {
                const double r = Vec3d(x, y, z).norm();
                if (r < 3.7 || r > 10.01) {
                    EXPECT_LT(solid(Vec3d(x, y, z)), 0) << x << ' ' << y << ' ' << z;
                } else if (r > 4.01 && r < 9.8) {
                    EXPECT_GT(solid(Vec3d(x, y, z)), 0) << x << ' ' << y << ' ' << z;
                }
            }
}

TEST_F(DelaunayRemesh, Sphere) {
    const TriMesh in = test::icosphere(5, 10);
    const TriMesh mesh = delaunay_remesh(in, bound(0.8));
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(m.area_A2, 400 * M_PI, 0.02 * 400 * M_PI);
    EXPECT_NEAR(*m.volume_A3, 4000 * M_PI / 3, 0.02 * 4000 * M_PI / 3);
    for (const Vec3f& p : mesh.points) ASSERT_NEAR(p.norm(), 10, 0.02);
    EXPECT_LT(mesh.triangles.size(), in.triangles.size());
}

TEST_F(DelaunayRemesh, TorusFarFromTheOrigin) {
    const TriMesh in = test::moved(test::torus_mesh(10, 3), Mat3d::Identity(), Vec3d(1000, -500, 20));
    const TriMesh mesh = delaunay_remesh(in, bound(0.7));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_EQ(m.genus, 1);
    EXPECT_NEAR(*m.volume_A3, 2 * M_PI * M_PI * 90, 0.04 * 2 * M_PI * M_PI * 90);
}

TEST_F(DelaunayRemesh, SmallComponentsAndCavitiesStay) {
    const TriMesh tiny = test::moved(test::icosphere(2, 0.3), Mat3d::Identity(), Vec3d(14, 0, 0));
    const TriMesh in =
        test::joined(test::joined(test::icosphere(4, 10), test::flipped(test::icosphere(3, 4))), tiny);
    const TriMesh mesh = delaunay_remesh(in, bound(1.5));
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.components, 3u);
    EXPECT_NEAR(*m.volume_A3, 4 * M_PI / 3 * (1000 - 64), 0.05 * 4 * M_PI / 3 * 936);
}

TEST_F(DelaunayRemesh, RefusesWhatHasNoInside) {
    TriMesh open = test::icosphere(2, 1);
    open.triangles.pop_back();
    EXPECT_THROW(delaunay_remesh(open, bound(0.2)), InvalidInput);
    TriMesh turned = test::icosphere(2, 1);
    std::swap(turned.triangles[5][0], turned.triangles[5][1]);
    EXPECT_THROW(delaunay_remesh(turned, bound(0.2)), InvalidInput);
    EXPECT_THROW(delaunay_remesh(test::icosphere(2, 1), {}), InvalidInput);
    EXPECT_TRUE(delaunay_remesh({}, bound(1)).empty());
}

TEST_F(DelaunayRemesh, CapsAndCancel) {
    DelaunayRemeshOptions few = bound(0.3);
    few.max_vertices = 100;
    EXPECT_THROW(delaunay_remesh(test::icosphere(3, 10), few), NumericalError);
    EXPECT_THROW(
        delaunay_remesh(test::icosphere(4, 10), bound(0.5), Progress([](double f) { return f < 0.3; })),
        Cancelled);
}

TEST_F(DelaunayRemesh, TheSameBytesAgain) {
    const TriMesh a = delaunay_remesh(test::torus_mesh(10, 3), bound(1)),
                  b = delaunay_remesh(test::torus_mesh(10, 3), bound(1));
    EXPECT_EQ(a.triangles, b.triangles);
    EXPECT_EQ(a.points, b.points);
}

}  // namespace
}  // namespace vdbgeo
