#include "vdbgeo/measure/triangle_tree.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <random>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

/// Nearest point on one triangle by trying its inside, its sides and its corners: slow, with nothing shared
/// with the tree.
double slow_distance2(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    double best = std::min({(p - a).squaredNorm(), (p - b).squaredNorm(), (p - c).squaredNorm()});
    const auto side = [&](const Vec3d& u, const Vec3d& v) {
        const double t = (v - u).dot(p - u) / (v - u).squaredNorm();
        if (t > 0 && t < 1) best = std::min(best, (u + t * (v - u) - p).squaredNorm());
    };
    side(a, b), side(b, c), side(c, a);
    const Vec3d n = (b - a).cross(c - a);
    const Vec3d q = p - n * (n.dot(p - a) / n.squaredNorm());
    if (n.dot((b - a).cross(q - a)) >= 0 && n.dot((c - b).cross(q - b)) >= 0 &&
        n.dot((a - c).cross(q - c)) >= 0)
        best = std::min(best, (q - p).squaredNorm());
    return best;
}

Vec3d corner(const TriMesh& mesh, std::uint64_t face, std::size_t c) {
    return mesh.points[mesh.triangles[face][c]].cast<double>();
}

struct SlowNearest {
    double distance2 = std::numeric_limits<double>::infinity();
    std::uint64_t face = 0;
};

SlowNearest slow_nearest(const TriMesh& mesh, const Vec3d& p) {
    SlowNearest best;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const double d = slow_distance2(p, corner(mesh, f, 0), corner(mesh, f, 1), corner(mesh, f, 2));
        if (d < best.distance2) best = {d, f};
    }
    return best;
}

void expect_slow_answers(const TriMesh& mesh, const Vec3d& centre, double spread, int count) {
    const TriangleTree tree(mesh);
    std::mt19937 random(7);
    std::normal_distribution<double> normal(0, spread);
    for (int i = 0; i < count; ++i) {
        const Vec3d p = centre + Vec3d(normal(random), normal(random), normal(random));
        const TriangleTree::Nearest found = tree.nearest(p);
        const SlowNearest slow = slow_nearest(mesh, p);
        EXPECT_NEAR(std::sqrt(found.squared_distance), std::sqrt(slow.distance2), 1e-10);
        EXPECT_EQ((found.point - p).squaredNorm(), found.squared_distance);
        // The point lies on the face that is named.
        EXPECT_LT(slow_distance2(found.point, corner(mesh, found.face, 0), corner(mesh, found.face, 1),
                                 corner(mesh, found.face, 2)),
                  1e-18);
    }
}

}  // namespace

TEST(TriangleTree, AgreesWithTryingEveryFace) {
    expect_slow_answers(icosphere(3, 10), Vec3d::Zero(), 8, 300);
    expect_slow_answers(torus_mesh(20, 6), Vec3d(3, 1, 2), 15, 300);
    expect_slow_answers(open_cylinder_mesh(5, 30), Vec3d(0, 0, 10), 10, 300);
}

TEST(TriangleTree, AgreesFarFromTheOrigin) {
    const Vec3d shift(4000, -7000, 12000);
    expect_slow_answers(moved(icosphere(3, 10), Mat3d::Identity(), shift), shift, 8, 300);
}

TEST(TriangleTree, EverySizeOfMesh) {
    const TriMesh sphere = icosphere(2, 10);
    for (std::size_t faces = 1; faces <= 90; ++faces) {
        TriMesh part = sphere;
        part.triangles.resize(faces);
        const TriangleTree tree(part);
        for (std::size_t f = 0; f < faces; ++f) {
            const Vec3d middle = (corner(part, f, 0) + corner(part, f, 1) + corner(part, f, 2)) / 3;
            const auto found = tree.nearest(1.01 * middle);
            EXPECT_EQ(found.face, f) << faces;
        }
    }
}

TEST(TriangleTree, TiesGoToTheLowestFace) {
    // Sixty copies of each face; and the corners, which six faces share.
    TriMesh mesh = icosphere(1, 10);
    const Array<Triangle> once = mesh.triangles;
    for (int copy = 1; copy < 60; ++copy)
        mesh.triangles.insert(mesh.triangles.end(), once.begin(), once.end());
    const TriangleTree tree(mesh);
    for (std::size_t f = 0; f < once.size(); ++f)
        EXPECT_EQ(tree.nearest((corner(mesh, f, 0) + corner(mesh, f, 1) + corner(mesh, f, 2)) / 2).face, f);
    for (VertexId v = 0; v < mesh.points.size(); ++v) {
        const auto found = tree.nearest(1.5 * mesh.points[v].cast<double>());
        std::size_t lowest = 0;
        while (std::find(once[lowest].begin(), once[lowest].end(), v) == once[lowest].end()) ++lowest;
        EXPECT_EQ(found.face, lowest);
        EXPECT_EQ(found.point, mesh.points[v].cast<double>());
    }
}

TEST(TriangleTree, ReachIsKept) {
    const TriangleTree tree(icosphere(3, 10));
    const Vec3d p(20, 0, 0);
    const auto anywhere = tree.nearest(p);
    EXPECT_NEAR(std::sqrt(anywhere.squared_distance), 10, 0.1);
    EXPECT_EQ(tree.nearest(p, anywhere.squared_distance).face, anywhere.face);
    EXPECT_EQ(tree.nearest(p, anywhere.squared_distance).squared_distance, anywhere.squared_distance);
    EXPECT_TRUE(std::isinf(tree.nearest(p, 0.999 * anywhere.squared_distance).squared_distance));
    EXPECT_TRUE(std::isinf(TriangleTree(TriMesh()).nearest(p).squared_distance));
}

TEST(TriangleTree, FacesWithoutAreaAreSegmentsAndPoints) {
    TriMesh mesh;
    mesh.points = {Vec3f(0, 0, 0), Vec3f(10, 0, 0), Vec3f(4, 0, 0), Vec3f(0, 20, 0)};
    mesh.triangles = {{0, 1, 2}, {3, 3, 3}, {3, 3, 3}};
    const TriangleTree tree(mesh);
    const auto segment = tree.nearest(Vec3d(7, 3, 0));
    EXPECT_EQ(segment.face, 0u);
    EXPECT_NEAR((segment.point - Vec3d(7, 0, 0)).norm(), 0, 1e-12);
    const auto point = tree.nearest(Vec3d(0, 18, 1));
    EXPECT_EQ(point.face, 1u);
    EXPECT_EQ(point.squared_distance, 5);
}

TEST(TriangleTree, BadMeshesAreRefused) {
    TriMesh index = icosphere(0, 1);
    index.triangles[7][1] = 99;
    EXPECT_THROW(TriangleTree{index}, InvalidInput);
    TriMesh number = icosphere(0, 1);
    number.points[3].y() = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(TriangleTree{number}, InvalidInput);
}

TEST(TriangleTree, TheSameForAnyNumberOfThreads) {
    const TriMesh mesh = torus_mesh(20, 6, 400, 100);
    std::vector<Vec3d> points;
    std::vector<TriangleTree::Nearest> answers[2];
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0, 12);
    for (int i = 0; i < 2000; ++i) points.emplace_back(normal(random), normal(random), normal(random));
    for (std::size_t threads = 1; threads <= 2; ++threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const TriangleTree tree(mesh);
        for (const Vec3d& p : points) answers[threads - 1].push_back(tree.nearest(p));
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_EQ(answers[0][i].face, answers[1][i].face);
        EXPECT_EQ(answers[0][i].point, answers[1][i].point);
    }
}
