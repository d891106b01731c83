#include "vdbgeo/measure/self_intersections.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

class SelfIntersections : public testing::Test {
 protected:
    void SetUp() override {
        if (!have_self_intersections()) GTEST_SKIP() << "this build has no CGAL";
    }
};

TriMesh mesh_of(const std::vector<Vec3f>& points, const std::vector<Triangle>& triangles) {
    TriMesh mesh;
    mesh.points.assign(points.begin(), points.end());
    mesh.triangles.assign(triangles.begin(), triangles.end());
    return mesh;
}

TEST_F(SelfIntersections, NoneInSoundSurfaces) {
    EXPECT_TRUE(self_intersections({}).empty());
    EXPECT_TRUE(self_intersections(test::icosphere(3, 10)).empty());
    EXPECT_TRUE(self_intersections(test::torus_mesh(10, 3)).empty());
    EXPECT_TRUE(self_intersections(test::joined(test::icosphere(2, 10), test::icosphere(2, 5))).empty());
}

TEST_F(SelfIntersections, TwoFacesThatCutAndTwoThatTouch) {
    const std::vector<Vec3f> flat = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
    const auto with = [&](const Vec3f& a, const Vec3f& b, const Vec3f& c) {
        std::vector<Vec3f> points = flat;
        points.insert(points.end(), {a, b, c});
        return self_intersections(mesh_of(points, {{0, 1, 2}, {3, 4, 5}}));
    };
    EXPECT_EQ(with({1, 1, -1}, {1, 1, 1}, {3, 3, 1}), (Pairs{{0, 1}}));
    EXPECT_EQ(with({1, 1, 0}, {1, 1, 1}, {3, 3, 1}), (Pairs{{0, 1}}));  // a corner in the face
    EXPECT_EQ(with({1, 1, 0.001f}, {1, 1, 1}, {3, 3, 1}), Pairs{});
    EXPECT_EQ(with({1, 1, 0}, {2, 1, 0}, {1, 2, 0}), (Pairs{{0, 1}}));  // in one plane, one in the other
    EXPECT_EQ(with({5, 5, 0}, {6, 5, 0}, {5, 6, 0}), Pairs{});
}

TEST_F(SelfIntersections, FacesAtASharedVertexOrEdge) {
    // At vertex 0: apart, and through the other face.
    EXPECT_TRUE(self_intersections(mesh_of({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {-1, 0, 1}, {-1, 1, 0}},
                                           {{0, 1, 2}, {0, 3, 4}}))
                    .empty());
    EXPECT_EQ(self_intersections(
                  mesh_of({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, 1}, {1, 1, -1}}, {{0, 1, 2}, {0, 3, 4}})),
              (Pairs{{0, 1}}));
    // At edge (0, 1): a fold that is not flat, a flat one, a flat continuation, and the face twice.
    const std::vector<Vec3f> p = {{0, 0, 0}, {4, 0, 0}, {1, 3, 0}, {1, 3, 1}, {2, 1, 0}, {1, -3, 0}};
    EXPECT_TRUE(self_intersections(mesh_of(p, {{0, 1, 2}, {1, 0, 3}})).empty());
    EXPECT_EQ(self_intersections(mesh_of(p, {{0, 1, 2}, {1, 0, 4}})), (Pairs{{0, 1}}));
    EXPECT_TRUE(self_intersections(mesh_of(p, {{0, 1, 2}, {1, 0, 5}})).empty());
    EXPECT_EQ(self_intersections(mesh_of(p, {{0, 1, 2}, {2, 1, 0}})), (Pairs{{0, 1}}));
}

TEST_F(SelfIntersections, FacesWithoutAreaAreInNoPair) {
    EXPECT_TRUE(
        self_intersections(mesh_of({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1, 1, 1}, {1, 1, 0}},
                                   {{0, 1, 2}, {3, 4, 5}, {3, 3, 4}}))
            .empty());
}

TEST_F(SelfIntersections, NonManifoldEdgesAreNoIntersections) {
    EXPECT_TRUE(self_intersections(mesh_of({{0, 0, 0}, {4, 0, 0}, {1, 3, 0}, {1, 0, 3}, {1, -2, -2}},
                                           {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}}))
                    .empty());
}

/// Segment (p, q) through triangle (a, b, c), in general position.
bool pierces(const Vec3d& p, const Vec3d& q, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const auto side = [](const Vec3d& u, const Vec3d& v, const Vec3d& w, const Vec3d& x) {
        return (v - u).cross(w - u).dot(x - u) > 0;
    };
    return side(a, b, c, p) != side(a, b, c, q) && side(p, q, a, b) == side(p, q, b, c) &&
           side(p, q, b, c) == side(p, q, c, a);
}

TEST_F(SelfIntersections, AsByTryingAllPairs) {
    std::mt19937_64 random(4);
    const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
    TriMesh soup;
    for (std::uint32_t f = 0; f < 300; ++f) {
        const Vec3d at(10 * uniform(), 10 * uniform(), 10 * uniform());
        for (int k = 0; k < 3; ++k)
            soup.points.push_back((at + 3 * Vec3d(uniform(), uniform(), uniform())).cast<float>());
        soup.triangles.push_back({3 * f, 3 * f + 1, 3 * f + 2});
    }
    Pairs expected;
    for (std::uint32_t f = 0; f < 300; ++f)
        for (std::uint32_t g = f + 1; g < 300; ++g) {
            const auto at = [&](std::uint32_t t, int k) -> Vec3d {
                return soup.points[3 * t + static_cast<std::uint32_t>(k % 3)].cast<double>();
            };
            bool cut = false;
            for (int k = 0; k < 3; ++k)
                cut = cut || pierces(at(f, k), at(f, k + 1), at(g, 0), at(g, 1), at(g, 2)) ||
                      pierces(at(g, k), at(g, k + 1), at(f, 0), at(f, 1), at(f, 2));
            if (cut) expected.emplace_back(f, g);
        }
    EXPECT_GT(expected.size(), 100u);
    EXPECT_EQ(self_intersections(soup), expected);
}

TEST_F(SelfIntersections, CanBeCancelled) {
    EXPECT_THROW(self_intersections(test::icosphere(2, 1), Progress([](double) { return false; })),
                 Cancelled);
}

}  // namespace
}  // namespace vdbgeo
