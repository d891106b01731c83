// Shapes of tetrahedra: known ones, a slow twin, and what is summed over a mesh.
#include "vdbgeo/tet/tet_quality.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/support/tet_meshes.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

constexpr double pi = 3.14159265358979323846, degrees = 180 / pi;

TetShape shape_of(const TetMesh& mesh, std::size_t t = 0) {
    const Tetrahedron& v = mesh.tets[t];
    return tet_shape(mesh.points[v[0]], mesh.points[v[1]], mesh.points[v[2]], mesh.points[v[3]]);
}

/// Another way to the same numbers: the angle between what two corners have across their edge, in the plane
/// at right angles to it; the circumcentre by a linear system. In long double.
struct Twin {
    double volume;
    std::array<double, 6> dihedral;
    double radius_edge;
};

Twin twin_of(const std::array<Vec3d, 4>& corners) {
    using V = Eigen::Matrix<long double, 3, 1>;
    std::array<V, 4> p;
    for (std::size_t k = 0; k < 4; ++k) p[k] = corners[k].cast<long double>();
    Twin twin{};
    Eigen::Matrix<long double, 3, 3> m;
    Eigen::Matrix<long double, 3, 1> right;
    for (int r = 0; r < 3; ++r) {
        const V u = p[static_cast<std::size_t>(r) + 1] - p[0];
        m.row(r) = u.transpose();
        right[r] = u.squaredNorm() / 2;
    }
    twin.volume = static_cast<double>(m.determinant() / 6);
    long double shortest = std::numeric_limits<long double>::infinity();
    for (std::size_t e = 0; e < 6; ++e) {
        const auto i = static_cast<std::size_t>(tet_edges[e][0]),
                   j = static_cast<std::size_t>(tet_edges[e][1]);
        const V along = (p[j] - p[i]).normalized();
        std::vector<V> wings;
        for (std::size_t k = 0; k < 4; ++k)
            if (k != i && k != j) wings.push_back(p[k] - p[i] - (p[k] - p[i]).dot(along) * along);
        twin.dihedral[e] = degrees * static_cast<double>(
                                         std::atan2(wings[0].cross(wings[1]).norm(), wings[0].dot(wings[1])));
        shortest = std::min(shortest, (p[j] - p[i]).norm());
    }
    const V centre = m.fullPivLu().solve(right);
    twin.radius_edge = static_cast<double>(centre.norm() / shortest);
    return twin;
}

}  // namespace

TEST(TetShape, OfTheRegularTetrahedron) {
    const TetShape s = shape_of(regular_tet());
    for (const double angle : s.dihedral_deg) EXPECT_NEAR(angle, std::acos(1.0 / 3) * degrees, 1e-12);
    EXPECT_NEAR(s.min_dihedral_deg, 70.528779365509308, 1e-12);
    EXPECT_NEAR(s.max_dihedral_deg, 70.528779365509308, 1e-12);
    EXPECT_NEAR(s.radius_edge, std::sqrt(6.0) / 4, 1e-15);
    EXPECT_NEAR(s.volume, 8.0 / 3, 1e-15);
}

TEST(TetShape, OfTheCornerOfACube) {
    const TetShape s = tet_shape({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    for (std::size_t e = 0; e < 6; ++e)  // three at the corner, three around the slanted face
        EXPECT_NEAR(s.dihedral_deg[e], e < 3 ? 90 : std::acos(1 / std::sqrt(3.0)) * degrees, 1e-12);
    EXPECT_NEAR(s.radius_edge, std::sqrt(3.0) / 2, 1e-15);
    EXPECT_NEAR(s.volume, 1.0 / 6, 1e-16);
}

// Four points close to a circle, evenly: no short edge and a small circumsphere, yet flat.
TEST(TetShape, OfASliver) {
    const double e = 1e-3;
    const TetShape s = tet_shape({1, 0, e}, {0, 1, -e}, {-1, 0, e}, {0, -1, -e});
    EXPECT_NEAR(s.radius_edge, std::sqrt(0.5), 1e-5);
    EXPECT_LT(s.min_dihedral_deg, 0.33);
    EXPECT_GT(s.max_dihedral_deg, 179.5);
    EXPECT_NE(s.volume, 0);
}

TEST(TetShape, OfNeedleAndCap) {
    // A needle: a small regular base, a tip far away. Its edges up are as long as the circumdiameter, nearly.
    const double r = 1e-3;
    const TetShape needle =
        tet_shape({r, 0, 0}, {-r / 2, r * std::sqrt(0.75), 0}, {-r / 2, -r * std::sqrt(0.75), 0}, {0, 0, 1});
    EXPECT_NEAR(needle.volume, std::sqrt(3.0) * 0.75 * r * r / 3, 1e-15);
    EXPECT_NEAR(needle.min_dihedral_deg, 60, 1e-3);
    EXPECT_NEAR(needle.max_dihedral_deg, 90, 0.1);
    EXPECT_NEAR(needle.radius_edge, (1 + r * r) / 2 / (std::sqrt(3.0) * r), 1e-9);
    // A cap: the tip a little above the middle of its base. tan of the angle at the base = height / inradius.
    const double h = 1e-6;
    const TetShape cap =
        tet_shape({1, 0, 0}, {-0.5, std::sqrt(0.75), 0}, {-0.5, -std::sqrt(0.75), 0}, {0, 0, h});
    EXPECT_NEAR(cap.min_dihedral_deg / (std::atan(2 * h) * degrees), 1, 1e-12);
    EXPECT_NEAR(cap.max_dihedral_deg, 180, 0.01);
    EXPECT_NEAR(cap.radius_edge / ((1 + h * h) / (2 * h) / std::hypot(1, h)), 1, 1e-9);
}

TEST(TetShape, FlatAndTurnedOver) {
    const TetShape turned = tet_shape({1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1});
    EXPECT_NEAR(turned.volume, -8.0 / 3, 1e-15);
    EXPECT_NEAR(turned.min_dihedral_deg, 70.528779365509308, 1e-12);
    EXPECT_NEAR(turned.radius_edge, std::sqrt(6.0) / 4, 1e-15);
    const TetShape flat = tet_shape({1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0});
    EXPECT_EQ(flat.volume, 0);
    EXPECT_EQ(flat.min_dihedral_deg, 0);
    EXPECT_EQ(flat.max_dihedral_deg, 180);
    EXPECT_EQ(flat.radius_edge, std::numeric_limits<double>::infinity());
    for (const TetShape& none : {tet_shape({0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}),
                                 tet_shape({1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3})}) {
        EXPECT_EQ(none.volume, 0);
        EXPECT_EQ(none.min_dihedral_deg, 0);
        EXPECT_EQ(none.max_dihedral_deg, 0);
        EXPECT_EQ(none.radius_edge, std::numeric_limits<double>::infinity());
    }
}

TEST(TetShape, IsThatOfItsTwin) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 20000; ++i) {
        std::array<Vec3d, 4> p;
        const double flatness = std::pow(10, -(i % 6));
        for (Vec3d& c : p) c = Vec3d(normal(random), normal(random), flatness * normal(random));
        const TetShape s = tet_shape(p[0], p[1], p[2], p[3]);
        const Twin twin = twin_of(p);
        EXPECT_NEAR(s.volume, twin.volume, 1e-14 + 1e-10 * std::abs(twin.volume));
        for (std::size_t e = 0; e < 6; ++e)
            EXPECT_NEAR(s.dihedral_deg[e], twin.dihedral[e], 1e-6 * flatness + 1e-9);
        EXPECT_NEAR(s.radius_edge / twin.radius_edge, 1, 1e-7);
        EXPECT_EQ(s.min_dihedral_deg, *std::min_element(s.dihedral_deg.begin(), s.dihedral_deg.end()));
        EXPECT_EQ(s.max_dihedral_deg, *std::max_element(s.dihedral_deg.begin(), s.dihedral_deg.end()));
    }
}

TEST(TetShape, OfAnySizeAndAnywhere) {
    const Vec3d a(1, 0.2, 0), b(-1, 1, 0.3), c(0.1, -1, 0.5), d(0, 0, 2);
    const TetShape one = tet_shape(a, b, c, d);
    for (const double size : {1e-8, 1e-4, 1.0, 1e4, 1e8}) {
        const TetShape s = tet_shape(size * a, size * b, size * c, size * d);
        EXPECT_NEAR(s.volume / (size * size * size), one.volume, 1e-13);
        EXPECT_NEAR(s.radius_edge, one.radius_edge, 1e-13);
        for (std::size_t e = 0; e < 6; ++e) EXPECT_NEAR(s.dihedral_deg[e], one.dihedral_deg[e], 1e-11);
    }
    const Vec3d far(1e6, -2e6, 3e6);
    const TetShape s = tet_shape(a + far, b + far, c + far, d + far);
    EXPECT_NEAR(s.volume, one.volume, 1e-8);
    EXPECT_NEAR(s.radius_edge, one.radius_edge, 1e-8);
    for (std::size_t e = 0; e < 6; ++e) EXPECT_NEAR(s.dihedral_deg[e], one.dihedral_deg[e], 1e-6);
}

TEST(TetQuality, OfNothingIsNothing) {
    const TetQuality q = measure_tets({});
    EXPECT_EQ(q.tets, 0u);
    EXPECT_EQ(q.volume_A3, 0);
    EXPECT_EQ(q.min_dihedral_deg, 0);
    EXPECT_EQ(q.min_edge_A, 0);
    EXPECT_TRUE(q.regions.empty());
}

TEST(TetQuality, OfACubeLattice) {
    TetMesh mesh = kuhn_box(5, 6, 7, 0.5);
    set_faces(mesh);
    const TetQuality q = measure_tets(mesh);
    EXPECT_EQ(q.vertices, 6u * 7 * 8);
    EXPECT_EQ(q.tets, 6u * 5 * 6 * 7);
    EXPECT_EQ(q.boundary_faces, 4u * (5 * 6 + 6 * 7 + 7 * 5));
    EXPECT_NEAR(q.volume_A3, 210 * 0.125, 1e-12);
    EXPECT_NEAR(q.min_volume_A3, 0.125 / 6, 1e-15);
    EXPECT_NEAR(q.max_volume_A3, 0.125 / 6, 1e-15);
    EXPECT_NEAR(q.min_dihedral_deg, 45, 1e-9);
    EXPECT_NEAR(q.max_dihedral_deg, 90, 1e-9);
    EXPECT_NEAR(q.mean_min_dihedral_deg, 45, 1e-9);
    EXPECT_NEAR(q.min_dihedral_p01_deg, 45, 1e-5);
    EXPECT_NEAR(q.radius_edge_mean, std::sqrt(3.0) / 2, 1e-12);
    EXPECT_NEAR(q.radius_edge_max, std::sqrt(3.0) / 2, 1e-12);
    EXPECT_NEAR(q.min_edge_A, 0.5, 1e-12);
    EXPECT_NEAR(q.max_edge_A, 0.5 * std::sqrt(3.0), 1e-12);
    EXPECT_NEAR(q.mean_edge_A, 0.5 * (3 + 2 * std::sqrt(2.0) + std::sqrt(3.0)) / 6, 1e-12);
    EXPECT_EQ(q.slivers, 0u);
    EXPECT_EQ(q.inverted, 0u);
    ASSERT_EQ(q.regions.size(), 1u);
    EXPECT_EQ(q.regions[0].region, 1);
    EXPECT_EQ(q.regions[0].tets, q.tets);
    EXPECT_NEAR(q.regions[0].volume_A3, q.volume_A3, 1e-12);
}

TEST(TetQuality, CountsAndHistogramsAreThoseOfTheShapes) {
    TetMesh mesh = ball_tets(10, 2);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> shake(-0.6, 0.6);
    move_points(
        mesh, [&](const Vec3d& p) { return Vec3d(p + Vec3d(shake(random), shake(random), shake(random))); });
    mesh.points[mesh.tets[5][0]] = (mesh.points[mesh.tets[5][1]] + mesh.points[mesh.tets[5][2]]) / 2;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        mesh.regions.push_back(centroid(mesh, t).x() < 0 ? 7 : centroid(mesh, t).y() < 0 ? 2 : 1000000);
    set_faces(mesh);
    const TetQuality q = measure_tets(mesh);
    TetQuality slow;
    std::map<std::int32_t, std::pair<std::uint64_t, double>> regions;
    std::vector<double> smallest;
    double volume = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const TetShape s = shape_of(mesh, t);
        slow.inverted += s.volume <= 0;
        slow.slivers += s.min_dihedral_deg < 5 || s.max_dihedral_deg > 175;
        volume += s.volume;
        smallest.push_back(s.min_dihedral_deg);
        for (const double a : s.dihedral_deg)
            ++slow.dihedral_histogram[static_cast<std::size_t>(std::min(a, 179.0))];
        ++slow.radius_edge_histogram[static_cast<std::size_t>(std::min(99.0, s.radius_edge / 0.05))];
        ++regions[mesh.regions[t]].first;
        regions[mesh.regions[t]].second += s.volume;
    }
    EXPECT_GT(q.inverted, 0u);
    EXPECT_GT(q.slivers, 0u);
    EXPECT_EQ(q.inverted, slow.inverted);
    EXPECT_EQ(q.slivers, slow.slivers);
    EXPECT_NEAR(q.volume_A3, volume, 1e-9 * volume);
    EXPECT_EQ(q.dihedral_histogram, slow.dihedral_histogram);
    EXPECT_EQ(q.radius_edge_histogram, slow.radius_edge_histogram);
    std::sort(smallest.begin(), smallest.end());
    const auto rank = static_cast<std::size_t>(std::ceil(0.01 * static_cast<double>(smallest.size()))) - 1;
    EXPECT_FLOAT_EQ(static_cast<float>(q.min_dihedral_p01_deg), static_cast<float>(smallest[rank]));
    ASSERT_EQ(q.regions.size(), 3u);
    for (const TetRegion& region : q.regions) {
        EXPECT_EQ(region.tets, regions[region.region].first);
        EXPECT_NEAR(region.volume_A3, regions[region.region].second, 1e-9);
    }
    EXPECT_TRUE(q.regions[0].region == 2 && q.regions[1].region == 7 && q.regions[2].region == 1000000);
}

TEST(TetQuality, FlatTetrahedraHaveNoRatio) {
    TetMesh mesh = regular_tet();
    for (const Vec3d& p : {Vec3d(5, 0, 0), Vec3d(6, 0, 0), Vec3d(6, 1, 0), Vec3d(5, 1, 0)})
        mesh.points.push_back(p);
    mesh.tets.push_back({4, 5, 6, 7});
    const TetQuality q = measure_tets(mesh);
    EXPECT_EQ(q.inverted, 1u);
    EXPECT_EQ(q.slivers, 1u);
    EXPECT_NEAR(q.radius_edge_max, std::sqrt(6.0) / 4, 1e-12);
    EXPECT_NEAR(q.radius_edge_mean, std::sqrt(6.0) / 4, 1e-12);
    EXPECT_EQ(q.radius_edge_histogram.back(), 1u);
}

TEST(TetQuality, DoesNotDependOnTheNumberOfThreads) {
    TetMesh mesh = kuhn_box(30, 30, 30);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> shake(-0.2, 0.2);
    move_points(
        mesh, [&](const Vec3d& p) { return Vec3d(p + Vec3d(shake(random), shake(random), shake(random))); });
    std::vector<TetQuality> all;
    for (const std::size_t threads : {1u, 2u, 3u}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        all.push_back(measure_tets(mesh));
    }
    for (const TetQuality& q : all) {
        EXPECT_EQ(q.volume_A3, all[0].volume_A3);
        EXPECT_EQ(q.mean_min_dihedral_deg, all[0].mean_min_dihedral_deg);
        EXPECT_EQ(q.radius_edge_mean, all[0].radius_edge_mean);
        EXPECT_EQ(q.mean_edge_A, all[0].mean_edge_A);
        EXPECT_EQ(q.min_dihedral_p01_deg, all[0].min_dihedral_p01_deg);
        EXPECT_EQ(q.regions[0].volume_A3, all[0].regions[0].volume_A3);
    }
}

TEST(TetQuality, RefusesDamagedMeshesAndCanBeCancelled) {
    TetMesh mesh = regular_tet();
    mesh.tets[0][2] = 9;
    EXPECT_THROW(measure_tets(mesh), InvalidInput);
    EXPECT_THROW(measure_tets(kuhn_box(2, 2, 2), Progress([](double) { return false; })), Cancelled);
}

TEST(TetQuality, PropertiesAreTheShapes) {
    TetMesh mesh = kuhn_box(2, 2, 2);
    mesh.tet_properties.push_back({"radius_edge", 3, std::vector<float>(3 * mesh.tets.size(), 9)});
    mesh.tet_properties.push_back({"mine", 1, std::vector<float>(mesh.tets.size(), 4)});
    set_quality_properties(mesh);
    EXPECT_EQ(mesh.tet_properties.size(), 5u);
    EXPECT_NO_THROW(check(mesh, "mesh"));
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const TetShape s = shape_of(mesh, t);
        EXPECT_EQ(mesh.find_tet_property("min_dihedral_deg")->values[t],
                  static_cast<float>(s.min_dihedral_deg));
        EXPECT_EQ(mesh.find_tet_property("max_dihedral_deg")->values[t],
                  static_cast<float>(s.max_dihedral_deg));
        EXPECT_EQ(mesh.find_tet_property("radius_edge")->values[t], static_cast<float>(s.radius_edge));
        EXPECT_EQ(mesh.find_tet_property("volume_A3")->values[t], static_cast<float>(s.volume));
    }
}
