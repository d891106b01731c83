// The single steps of tet_optimize on configurations of a few tetrahedra.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/lattice_tets.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"
#include "vdbgeo/tet/tet_flips.h"
#include "vdbgeo/tet/tet_moves.h"
#include "vdbgeo/tet/tet_patches.h"

using namespace vdbgeo;

namespace {

const DihedralBounds bounds(20, 130);

TetMesh mesh_of(const std::vector<Vec3d>& points, const std::vector<Tetrahedron>& tets) {
    TetMesh mesh;
    mesh.points.assign(points.begin(), points.end());
    mesh.tets.assign(tets.begin(), tets.end());
    for (Tetrahedron& t : mesh.tets)
        if (tet_determinant(mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]], mesh.points[t[3]]) < 0)
            std::swap(t[2], t[3]);
    return mesh;
}

/// n tetrahedra around an edge of the given length (vertices 0 and 1); the polygon is regular, of radius 1.
TetMesh ring(int n, double length) {
    std::vector<Vec3d> points{{0, 0, -length / 2}, {0, 0, length / 2}};
    std::vector<Tetrahedron> tets;
    for (int k = 0; k < n; ++k) {
        points.emplace_back(std::cos(2 * M_PI * k / n), std::sin(2 * M_PI * k / n), 0);
        tets.push_back({0, 1, VertexId(2 + k), VertexId(2 + (k + 1) % n)});
    }
    return mesh_of(points, tets);
}

double volume(const TetMesh& mesh) {
    double sum = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        EXPECT_GT(tet_determinant(mesh, t), 0);
        sum += tet_determinant(mesh, t) / 6;
    }
    return sum;
}

/// The edge of tetrahedron 0 between vertices 0 and 1.
std::size_t edge_01(const TetMesh& mesh) {
    for (std::size_t e = 0; e < 6; ++e) {
        const VertexId a = mesh.tets[0][std::size_t(tet_edges[e][0])],
                       b = mesh.tets[0][std::size_t(tet_edges[e][1])];
        if (a + b == 1) return e;
    }
    ADD_FAILURE();
    return 0;
}

/// The best worst tetrahedron over all triangulations of the polygon i…j, by trying all.
double best_by_trying(const TetMesh& mesh, const std::vector<VertexId>& polygon) {
    if (polygon.size() < 3) return 1e30;
    double best = -2;
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {  // the triangle on the first and the last
        const auto p = [&](VertexId v) { return mesh.points[v]; };
        const VertexId i = polygon.front(), m = polygon[k], j = polygon.back();
        const double here = std::min(dihedral_worth(bounds, p(i), p(m), p(j), p(1)),
                                     dihedral_worth(bounds, p(i), p(j), p(m), p(0)));
        const auto middle = polygon.begin() + std::ptrdiff_t(k);
        best = std::max(best, std::min({here, best_by_trying(mesh, {polygon.begin(), middle + 1}),
                                        best_by_trying(mesh, {middle, polygon.end()})}));
    }
    return best;
}

/// An octahedron around vertex 0.
TetMesh octahedron(const Vec3d& centre) {
    std::vector<Vec3d> points{centre};
    for (int a = 0; a < 3; ++a)
        for (const double s : {-1.0, 1.0}) points.push_back(s * Vec3d::Unit(a));
    std::vector<Tetrahedron> tets;
    for (const VertexId x : {1, 2})
        for (const VertexId y : {3, 4})
            for (const VertexId z : {5, 6}) tets.push_back({0, x, y, z});
    return mesh_of(points, tets);
}

double star_worth(const TetMesh& mesh, const Vec3d& x) {
    double least = 1e30;
    for (const Tetrahedron& t : mesh.tets) {
        Vec3d p[4];
        for (std::size_t k = 0; k < 4; ++k) p[k] = t[k] == 0 ? x : mesh.points[t[k]];
        least = std::min(least, dihedral_worth(bounds, p[0], p[1], p[2], p[3]));
    }
    return least;
}

}  // namespace

TEST(DihedralWorth, IsWhatTheAnglesSay) {
    std::mt19937_64 random(1);
    const auto unit = [&] { return double(random() >> 11) * 0x1p-52 - 1; };
    for (int i = 0; i < 2000; ++i) {
        Vec3d p[4];
        for (Vec3d& x : p) x = Vec3d(unit(), unit(), unit());
        if (tet_determinant(p[0], p[1], p[2], p[3]) < 0) {
            EXPECT_EQ(dihedral_worth(bounds, p[0], p[1], p[2], p[3]), -1);
            std::swap(p[0], p[1]);
        }
        double worst = 1e30;
        for (const auto& [a, b] : tet_edges) {
            Vec3d away[2];
            int n = 0;
            const Vec3d axis = (p[b] - p[a]).normalized();
            for (int k = 0; k < 4; ++k)
                if (k != a && k != b) away[n] = p[k] - p[a], away[n] -= away[n].dot(axis) * axis, ++n;
            const double angle = std::atan2(away[0].cross(away[1]).norm(), away[0].dot(away[1]));
            worst = std::min({worst, std::sin(angle / 2) / std::sin(M_PI / 18),
                              std::cos(angle / 2) / std::cos(130 * M_PI / 360)});
        }
        EXPECT_NEAR(dihedral_worth(bounds, p[0], p[1], p[2], p[3]), worst * worst, 1e-9);
    }
    // Regular: both terms by hand; flat; a corner of a cube whose 90° is 1.67 against 130°.
    const double regular = dihedral_worth(bounds, {1, 1, 1}, {1, -1, -1}, {-1, -1, 1}, {-1, 1, -1});
    EXPECT_NEAR(regular, (4.0 / 3) / (1 + std::cos(130 * M_PI / 180)), 1e-12);
    EXPECT_EQ(dihedral_worth(bounds, {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}), 0);
    EXPECT_EQ(dihedral_worth(bounds, {0, 0, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 1}), 0);
}

TEST(TetFlips, ThreeBecomeTwoAndTwoBecomeThree) {
    const TetMesh bad = ring(3, 0.6);  // flat around a short edge: two tall ones are no better, three are
    const TetStore flat(bad, bounds, false);
    EXPECT_FALSE(edge_removal(flat, 0, edge_01(bad)));

    const TetMesh tall = ring(3, 6);
    const TetStore store(tall, bounds, false);
    const auto flip = edge_removal(store, 0, edge_01(tall));
    ASSERT_TRUE(flip);
    EXPECT_EQ(flip->old.size(), 3u);
    ASSERT_EQ(flip->fresh.size(), 2u);
    EXPECT_GT(flip->after, flip->before);
    TetMesh two = tall;
    two.tets.assign(flip->fresh.begin(), flip->fresh.end());
    EXPECT_NEAR(volume(two), volume(tall), 1e-12);
    EXPECT_NO_THROW(tet_adjacency(two));

    const TetMesh low = mesh_of({{0, 0, -0.3}, {0, 0, 0.3}, {1, 0, 0}, {-0.5, 0.866, 0}, {-0.5, -0.866, 0}},
                                {{0, 2, 3, 4}, {1, 2, 3, 4}});
    const TetStore pair(low, bounds, false);
    std::size_t k = 0;
    while (low.tets[0][k] != 0) ++k;
    const auto face = face_removal(pair, 0, k);
    ASSERT_TRUE(face);
    ASSERT_EQ(face->fresh.size(), 3u);
    TetMesh three = low;
    three.tets.assign(face->fresh.begin(), face->fresh.end());
    EXPECT_NEAR(volume(three), volume(low), 1e-12);
    EXPECT_NO_THROW(tet_adjacency(three));
    for (std::size_t other = 0; other < 4; ++other)  // faces of the boundary stay
        if (other != k) {
            EXPECT_FALSE(face_removal(pair, 0, other));
        }
    for (std::size_t e = 0; e < 6; ++e) EXPECT_FALSE(edge_removal(pair, 0, e));
}

TEST(TetFlips, EdgesOfFourToSevenGoTheBestWay) {
    for (int n = 4; n <= 8; ++n)
        for (int seed = 0; seed < 10; ++seed) {
            TetMesh mesh = ring(n, 5);
            std::mt19937_64 random{std::uint64_t(seed)};
            for (std::size_t v = 2; v < mesh.points.size(); ++v)
                for (int a = 0; a < 3; ++a)
                    mesh.points[v][a] += 0.15 * (double(random() >> 11) * 0x1p-52 - 1);
            const TetStore store(mesh, bounds, false);
            const auto flip = edge_removal(store, 0, edge_01(mesh));
            if (n == 8) {
                EXPECT_FALSE(flip);
                continue;
            }
            ASSERT_TRUE(flip) << n;
            EXPECT_EQ(flip->old.size(), std::size_t(n));
            EXPECT_EQ(flip->fresh.size(), std::size_t(2 * (n - 2)));
            std::vector<VertexId> polygon;
            for (int k = 0; k < n; ++k) polygon.push_back(VertexId(2 + k));
            EXPECT_NEAR(flip->after, best_by_trying(mesh, polygon), 1e-12);
            TetMesh after = mesh;
            after.tets.assign(flip->fresh.begin(), flip->fresh.end());
            EXPECT_NEAR(volume(after), volume(mesh), 1e-12);
            EXPECT_NO_THROW(tet_adjacency(after));
        }
}

TEST(TetFlips, RegionsAreNotMixed) {
    TetMesh mesh = ring(4, 6);
    mesh.regions.assign({1, 1, 2, 2});
    const TetStore store(mesh, bounds, false);
    EXPECT_FALSE(edge_removal(store, 0, edge_01(mesh)));
    mesh.regions.assign({3, 3, 3, 3});
    TetStore one(mesh, bounds, false);
    std::vector<std::uint32_t> tried;
    std::uint32_t epoch = 0;
    EXPECT_EQ(flip_tets(one, {0, 1, 2, 3}, tried, epoch), 1u);  // all four want the same one
    one.give_to(mesh);
    EXPECT_EQ(mesh.tets.size(), 4u);
    EXPECT_EQ(mesh.regions, Array<std::int32_t>(4, 3));
    volume(mesh);
}

TEST(TetFlips, SlotsAreUsedAgain) {
    TetMesh mesh = ring(7, 5);
    const double before = volume(mesh);
    TetStore store(mesh, bounds, false);
    std::vector<std::uint32_t> tried;
    std::uint32_t epoch = 0;
    EXPECT_EQ(flip_tets(store, {0}, tried, epoch), 1u);  // 7 → 10
    EXPECT_EQ(store.slot_count(), 10u);
    TetStore tall(ring(3, 6), bounds, false);
    EXPECT_EQ(flip_tets(tall, {0}, tried = {}, epoch), 1u);  // 3 → 2, one slot is dead
    EXPECT_EQ(tall.slot_count(), 3u);
    EXPECT_EQ(tall.worse_than(1e9).size(), 2u);
    store.give_to(mesh);
    EXPECT_EQ(mesh.tets.size(), 10u);
    EXPECT_NEAR(volume(mesh), before, 1e-12);
}

TEST(TetMoves, FindsTheBestPlaceInAnOctahedron) {
    for (const Vec3d& start : {Vec3d(0.7, 0.1, 0.05), Vec3d(0.1, -0.2, 0.65), Vec3d(-0.3, 0.3, 0.35)}) {
        TetMesh mesh = octahedron(start);
        TetStore store(mesh, bounds, false);
        std::vector<std::uint32_t> tried(mesh.points.size(), 0);
        std::uint32_t epoch = 0;
        std::vector<VertexId> all;
        for (VertexId v = 0; v < mesh.points.size(); ++v) all.push_back(v);
        ASSERT_LT(star_worth(mesh, start), 1);
        for (int i = 0; i < 5; ++i) move_vertices(store, all, {}, tried, epoch, {});
        for (VertexId v = 1; v < mesh.points.size(); ++v) EXPECT_EQ(store.point(v), mesh.points[v]);
        // The centre is best by symmetry: 90° and 54.7°. It is left where it is good enough on the way.
        EXPECT_GT(star_worth(mesh, store.point(0)), std::min(1.5, 0.98 * star_worth(mesh, Vec3d::Zero())));
    }
}

TEST(TetMoves, NoPlaceOfAFineGridIsMuchBetter) {
    // A star that can not be made good: the octahedron pressed flat. Its best place is found by trying.
    for (const double flat : {0.12, 0.2, 0.3}) {
        TetMesh mesh = octahedron(Vec3d(0.25, -0.2, 0.3 * flat));
        for (std::size_t v = 5; v < 7; ++v) mesh.points[v].z() *= flat;
        for (std::size_t v = 1; v < 7; ++v) mesh.points[v] += 0.05 * Vec3d(std::sin(v), std::cos(3 * v), 0);
        double best = 0;
        const int n = 40;
        for (int z = -n; z <= n; ++z)
            for (int y = -n; y <= n; ++y)
                for (int x = -n; x <= n; ++x)
                    best =
                        std::max(best, star_worth(mesh, Vec3d(0.5 * x / n, 0.5 * y / n, 0.5 * flat * z / n)));
        TetStore store(mesh, bounds, false);
        std::vector<std::uint32_t> tried(mesh.points.size(), 0);
        std::uint32_t epoch = 0;
        while (move_vertices(store, {0}, {}, tried, epoch, {}) > 0) {
        }
        EXPECT_GT(std::sqrt(star_worth(mesh, store.point(0))), 0.97 * std::sqrt(best)) << flat;
        EXPECT_GT(tried[0], 0u);
        const std::uint32_t at = tried[0];
        EXPECT_EQ(move_vertices(store, {0}, {}, tried, epoch, {}), 0u);
        EXPECT_EQ(tried[0], at);  // not tried again while nothing changed
    }
}

TEST(TetPatches, GoOnWhereSingleMovesAreStuck) {
    TetMesh mesh = test::lattice_tets([](const Vec3d& p) { return 1 - p.norm(); }, 1.1, 0.25);
    // Squeezed: everything is bad, and the boundary does not move.
    for (Vec3d& p : mesh.points) p.x() *= 0.35;
    TetStore store(mesh, bounds, false);
    std::vector<VertexId> all(mesh.points.size());
    for (VertexId v = 0; v < all.size(); ++v) all[v] = v;
    std::vector<std::uint32_t> tried(all.size(), 0), patches_tried;
    std::uint32_t epoch = 0;
    for (int i = 0; i < 100 && move_vertices(store, all, {}, tried, epoch, {}) > 0; ++i) {
    }
    std::vector<double> before;
    for (std::uint32_t t = 0; t < store.slot_count(); ++t) before.push_back(store.worth(t));
    const std::vector<std::uint32_t> stuck = store.worse_than(1);
    ASSERT_GT(stuck.size(), 10u);
    EXPECT_GT(move_patches(store, stuck, {}, patches_tried, epoch), 5u);
    // Tetrahedra may get worse, but not to less than the worst was.
    double worst = 1e30, sum = 0;
    for (std::uint32_t t = 0; t < store.slot_count(); ++t) {
        EXPECT_NEAR(store.worth(t), store.worth_of(store.tet(t)), 0);
        EXPECT_GT(store.worth(t), 0);
        worst = std::min(worst, store.worth(t));
        sum += store.worth(t) != before[t];
    }
    EXPECT_GE(worst, *std::min_element(before.begin(), before.end()));
    EXPECT_GT(sum, 20);
    for (const Triangle& f : mesh.faces)
        for (const VertexId v : f) EXPECT_EQ(store.point(v), mesh.points[v]);
}

TEST(TetPatches, MovesTwoVerticesWithTheSurface) {
    // One tetrahedron with all corners on a ball: only together they can make it better than by a little.
    const auto onto_ball = [](const Vec3d& p) -> std::optional<Vec3d> { return p.normalized(); };
    TetMesh mesh = mesh_of({Vec3d(1, 0.2, 0).normalized(), Vec3d(-1, 0.2, 0).normalized(),
                            Vec3d(0, -0.2, 1).normalized(), Vec3d(0, -0.2, -1).normalized()},
                           {{0, 1, 2, 3}});
    TetStore store(mesh, bounds, true);
    std::vector<std::uint32_t> tried;
    std::uint32_t epoch = 0;
    const double before = store.worth(0);
    ASSERT_LT(before, 1);
    for (int i = 0; i < 20; ++i) move_patches(store, {0}, onto_ball, tried, epoch);
    EXPECT_GT(store.worth(0), 1.44);
    for (VertexId v = 0; v < 4; ++v) EXPECT_NEAR(store.point(v).norm(), 1, 1e-15);
}
