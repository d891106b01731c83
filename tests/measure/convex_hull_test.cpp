// The convex hull of points.
#include "vdbgeo/measure/convex_hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "tests/support/small_meshes.h"
#include "tests/support/sound_mesh.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

class ConvexHull : public testing::Test {
 protected:
    void SetUp() override {
        if (!have_convex_hull()) GTEST_SKIP() << "this build has no CGAL";
    }
};

Array<Vec3f> ball(std::size_t count, unsigned seed, bool surface = false,
                  const Vec3d& stretch = {30, 20, 10}) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Array<Vec3f> points;
    for (std::size_t i = 0; i < count; ++i) {
        Vec3d d(normal(random), normal(random), normal(random));
        d.normalize();
        if (!surface) d *= std::cbrt(std::uniform_real_distribution<>()(random));
        points.push_back(d.cwiseProduct(stretch).cast<float>());
    }
    return points;
}

/// How far the points are outside of the planes of the faces, at most; Å.
double farthest_outside(const TriMesh& hull, const Array<Vec3f>& points) {
    double most = -std::numeric_limits<double>::infinity();
    for (const Triangle& t : hull.triangles) {
        const Vec3d a = hull.points[t[0]].cast<double>();
        const Vec3d n =
            (hull.points[t[1]].cast<double>() - a).cross(hull.points[t[2]].cast<double>() - a).normalized();
        for (const Vec3f& p : points) most = std::max(most, n.dot(p.cast<double>() - a));
    }
    return most;
}

bool same(const TriMesh& a, const TriMesh& b) {
    return a.triangles == b.triangles &&
           std::equal(a.points.begin(), a.points.end(), b.points.begin(), b.points.end());
}

}  // namespace

TEST_F(ConvexHull, OfACubeWithPointsInsideAndTwice) {
    Array<Vec3f> points = cube().points;
    points.insert(points.end(), points.begin(), points.end());
    for (const Vec3f& p : ball(100, 1, false, {0.4, 0.4, 0.4})) points.push_back(p + Vec3f::Constant(0.5f));
    const TriMesh hull = convex_hull(points);
    EXPECT_EQ(hull.points.size(), 8u);
    const MeshMeasures m = expect_closed_manifold(hull);
    EXPECT_EQ(m.faces, 12u);
    EXPECT_DOUBLE_EQ(*m.volume_A3, 1);
}

TEST_F(ConvexHull, HoldsEveryPointAndItsCornersAreSomeOfThem) {
    // 30 000 points go through the filter, 300 do not.
    for (const std::size_t count : {300u, 30000u}) {
        const Array<Vec3f> points = ball(count, 2);
        const TriMesh hull = convex_hull(points);
        EXPECT_GT(*expect_closed_manifold(hull).volume_A3, 0);
        EXPECT_LT(farthest_outside(hull, points), 1e-5);
        for (const Vec3f& p : hull.points)
            EXPECT_NE(std::find(points.begin(), points.end(), p), points.end());
    }
}

TEST_F(ConvexHull, OfManyPointsIsThatOfItsParts) {
    // The parts are too few for the filter.
    const Array<Vec3f> points = ball(60000, 3);
    Array<Vec3f> corners;
    for (std::size_t i = 0; i < points.size(); i += 3000) {
        const TriMesh part = convex_hull(
            Array<Vec3f>(points.begin() + std::ptrdiff_t(i), points.begin() + std::ptrdiff_t(i + 3000)));
        corners.insert(corners.end(), part.points.begin(), part.points.end());
    }
    EXPECT_TRUE(same(convex_hull(points), convex_hull(corners)));
}

TEST_F(ConvexHull, OfASphereKeepsAllPoints) {
    const Array<Vec3f> points = ball(6000, 4, true);
    EXPECT_EQ(convex_hull(points).points.size(), points.size());
}

TEST_F(ConvexHull, DoesNotDependOnTheOrder) {
    // Lattice points: many in one plane, where the triangles could be cut either way.
    Array<Vec3f> points;
    for (int i = 0; i < 20 * 20 * 20; ++i)
        points.emplace_back(float(i % 20), float(i / 20 % 20), float(i / 400));
    const TriMesh hull = convex_hull(points);
    EXPECT_NEAR(*expect_closed_manifold(hull).volume_A3, 19 * 19 * 19, 1e-9);
    std::shuffle(points.begin(), points.end(), std::mt19937(7));
    EXPECT_TRUE(same(hull, convex_hull(points)));
}

TEST_F(ConvexHull, FarFromTheOrigin) {
    Array<Vec3f> points = ball(5000, 5);
    for (Vec3f& p : points) p += Vec3f(1e6f, -1e6f, 1e6f);
    const TriMesh hull = convex_hull(points);
    EXPECT_GT(*expect_closed_manifold(hull).volume_A3, 20000);
    EXPECT_LT(farthest_outside(hull, points), 1e-5);
}

TEST_F(ConvexHull, RefusesWhatHasNoVolume) {
    const auto refuse = [](const Array<Vec3f>& points, const std::string& text) {
        try {
            convex_hull(points);
            ADD_FAILURE() << text;
        } catch (const InvalidInput& e) {
            EXPECT_NE(std::string(e.what()).find(text), std::string::npos) << e.what();
        }
    };
    refuse({}, "0 points without a volume");
    refuse({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, "3 points");
    refuse(Array<Vec3f>(100, Vec3f(1, 2, 3)), "100 points");
    Array<Vec3f> line, plane = ball(9000, 6);
    for (int i = 0; i < 50; ++i) line.emplace_back(float(i), float(2 * i), float(-i));
    for (Vec3f& p : plane) p.z() = 3;
    refuse(line, "without a volume");
    refuse(plane, "without a volume");
    Array<Vec3f> bad = cube().points;
    bad[3].y() = std::numeric_limits<float>::quiet_NaN();
    refuse(bad, "point 3 is not finite");
}

TEST(ConvexHullMissing, SaysSo) {
    if (have_convex_hull()) GTEST_SKIP() << "this build has CGAL";
    EXPECT_THROW(convex_hull(cube().points), InvalidInput);
}
