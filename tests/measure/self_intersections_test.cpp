// Self-intersections: clean meshes, crossing ones, contacts at shared vertices and edges, and a brute-force
// twin.
#include "vdbgeo/measure/self_intersections.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

#define NEEDS_CGAL() \
    if (!have_self_intersections()) GTEST_SKIP() << "no CGAL in this build"

TriMesh mesh_of(std::initializer_list<Vec3f> points, std::initializer_list<Triangle> triangles) {
    TriMesh mesh;
    for (const Vec3f& p : points) mesh.points.push_back(p);
    for (const Triangle& t : triangles) mesh.triangles.push_back(t);
    return mesh;
}

/// Whether the segment pq goes through the triangle abc; for general positions only.
bool pierced(const Vec3d& p, const Vec3d& q, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const auto side = [](const Vec3d& u, const Vec3d& v, const Vec3d& w, const Vec3d& x) {
        return (v - u).cross(w - u).dot(x - u) > 0;
    };
    if (side(a, b, c, p) == side(a, b, c, q)) return false;
    const bool s = side(p, q, a, b);
    return s == side(p, q, b, c) && s == side(p, q, c, a);
}

}  // namespace

TEST(SelfIntersections, NoneInCleanMeshes) {
    NEEDS_CGAL();
    EXPECT_EQ(self_intersections(icosphere(3, 10)), Pairs());
    EXPECT_EQ(self_intersections(torus_mesh(3, 1)), Pairs());
    EXPECT_EQ(self_intersections(open_cylinder_mesh(1, 2)), Pairs());
    EXPECT_EQ(self_intersections({}), Pairs());
    // One sphere in another does not cut it.
    EXPECT_EQ(self_intersections(joined(icosphere(2, 10), icosphere(2, 5))), Pairs());
}

TEST(SelfIntersections, CrossingSpheresCutEachOther) {
    NEEDS_CGAL();
    const TriMesh one = icosphere(2, 1), two = moved(one, Mat3d::Identity(), Vec3d(0.83, 0.41, 0.29));
    const TriMesh both = joined(one, two);
    const Pairs found = self_intersections(both);
    EXPECT_GT(found.size(), 20u);
    const std::uint32_t first_of_two = static_cast<std::uint32_t>(one.triangles.size());
    for (const auto& [a, b] : found) {
        EXPECT_LT(a, first_of_two);
        EXPECT_GE(b, first_of_two);
    }
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    EXPECT_EQ(std::set(found.begin(), found.end()).size(), found.size());
}

TEST(SelfIntersections, AgreeWithABruteForceTwin) {
    NEEDS_CGAL();
    // Loose triangles in general position.
    const std::vector<float> random = noise(9 * 150, 5);
    TriMesh mesh;
    for (std::size_t i = 0; i < 3 * 150; ++i) {
        const Vec3f shift = 2 * Vec3f(random[i / 3 * 9], random[i / 3 * 9 + 4], random[i / 3 * 9 + 8]);
        mesh.points.push_back(shift + Vec3f(random[3 * i], random[3 * i + 1], random[3 * i + 2]));
    }
    for (VertexId t = 0; t < 150; ++t) mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    Pairs expected;
    const auto at = [&](VertexId v) { return Vec3d(mesh.points[v].cast<double>()); };
    for (std::uint32_t s = 0; s < 150; ++s)
        for (std::uint32_t t = s + 1; t < 150; ++t) {
            bool cut = false;
            for (VertexId k = 0; k < 3; ++k) {
                const VertexId n = (k + 1) % 3;
                cut = cut || pierced(at(3 * s + k), at(3 * s + n), at(3 * t), at(3 * t + 1), at(3 * t + 2)) ||
                      pierced(at(3 * t + k), at(3 * t + n), at(3 * s), at(3 * s + 1), at(3 * s + 2));
            }
            if (cut) expected.emplace_back(s, t);
        }
    EXPECT_GT(expected.size(), 20u);
    EXPECT_EQ(self_intersections(mesh), expected);
}

TEST(SelfIntersections, FacesAtASharedEdge) {
    NEEDS_CGAL();
    const auto hinge = [](const Vec3f& d) {
        return mesh_of({{0, 0, 0}, {1, 0, 0}, {0.3f, 1, 0}, d}, {{0, 1, 2}, {1, 0, 3}});
    };
    EXPECT_EQ(self_intersections(hinge({0.5f, -1, 0})), Pairs());            // flat, side by side
    EXPECT_EQ(self_intersections(hinge({0.5f, 0.5f, 0.01f})), Pairs());      // sharp, but not folded shut
    EXPECT_EQ(self_intersections(hinge({0.6f, 0.7f, 0})), (Pairs{{0, 1}}));  // folded onto each other
    EXPECT_EQ(self_intersections(hinge({0.3f, 1, 0})), (Pairs{{0, 1}}));     // the same triangle twice
}

TEST(SelfIntersections, FacesOnTheSameVertices) {
    NEEDS_CGAL();
    const TriMesh mesh = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}});
    EXPECT_EQ(self_intersections(mesh), (Pairs{{0, 1}}));
}

TEST(SelfIntersections, FacesAtASharedVertex) {
    NEEDS_CGAL();
    const auto pair = [](const Vec3f& d, const Vec3f& e) {
        return mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, d, e}, {{0, 1, 2}, {0, 3, 4}});
    };
    EXPECT_EQ(self_intersections(pair({-1, 0, 0}, {0, -1, 0})), Pairs());
    EXPECT_EQ(self_intersections(pair({0.3f, 0.3f, 1}, {-1, -1, 1})), Pairs());
    EXPECT_EQ(self_intersections(pair({0.4f, 0.3f, -1}, {0.3f, 0.4f, 1})), (Pairs{{0, 1}}));
}

TEST(SelfIntersections, TouchingWithoutSharedNumbersCounts) {
    NEEDS_CGAL();
    // The same place under two numbers.
    const TriMesh mesh =
        mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {-1, 0, 0}, {0, -1, 0}}, {{0, 1, 2}, {3, 4, 5}});
    EXPECT_EQ(self_intersections(mesh), (Pairs{{0, 1}}));
}

TEST(SelfIntersections, FacesWithoutAreaAreInNoPair) {
    NEEDS_CGAL();
    TriMesh mesh = icosphere(1, 1);
    const VertexId n = static_cast<VertexId>(mesh.points.size());
    for (const Vec3f& p : {Vec3f(-2, 0, 0), Vec3f(0, 0, 0), Vec3f(2, 0, 0)}) mesh.points.push_back(p);
    mesh.triangles.push_back({0, 0, 1});
    mesh.triangles.push_back({2, 2, 2});
    mesh.triangles.push_back({n, n + 1, n + 2});  // a line through the sphere
    EXPECT_EQ(self_intersections(mesh), Pairs());
}

TEST(SelfIntersections, BrokenMeshesAreRefusedAndCancelled) {
    NEEDS_CGAL();
    EXPECT_THROW(self_intersections(mesh_of({{0, 0, 0}}, {{0, 1, 2}})), InvalidInput);
    EXPECT_THROW(self_intersections(mesh_of(
                     {{0, 0, 0}, {1, 0, 0}, {0, std::numeric_limits<float>::quiet_NaN(), 0}}, {{0, 1, 2}})),
                 InvalidInput);
    EXPECT_THROW(self_intersections(icosphere(2, 1), Progress([](double) { return false; })), Cancelled);
}
