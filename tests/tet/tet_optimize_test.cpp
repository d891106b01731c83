#include "vdbgeo/tet/tet_optimize.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "converters/map_file.h"
#include "tests/support/data.h"
#include "tests/support/lattice_tets.h"
#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"
#include "vdbgeo/tet/isosurface_stuffing.h"
#include "vdbgeo/tet/map_projection.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

double ball(const Vec3d& p) { return 1 - p.norm(); }
double bumpy(const Vec3d& p) {
    return ball(p) + 0.05 * std::sin(9 * p.x()) * std::sin(8 * p.y() + 1) * std::sin(10 * p.z() + 2);
}
double torus(const Vec3d& p) { return 0.3 - std::hypot(std::hypot(p.x(), p.y()) - 0.7, p.z()); }

std::optional<Vec3d> onto_ball(const Vec3d& p) { return p.normalized(); }
std::optional<Vec3d> onto_bumpy(const Vec3d& p) {  // along the ray from the centre
    const Vec3d direction = p.normalized();
    double in = 0.5, out = 1.5;
    while (out - in > 1e-14) (bumpy(0.5 * (in + out) * direction) > 0 ? in : out) = 0.5 * (in + out);
    return Vec3d(in * direction);
}
std::optional<Vec3d> onto_torus(const Vec3d& p) {
    const Vec3d centre = 0.7 * Vec3d(p.x(), p.y(), 0).normalized();
    return Vec3d(centre + 0.3 * (p - centre).normalized());
}

/// Angles from the directions in which the faces leave each edge.
std::array<double, 6> dihedrals(const TetMesh& mesh, std::size_t t) {
    std::array<double, 6> angles{};
    for (std::size_t e = 0; e < 6; ++e) {
        const auto p = [&](int k) { return mesh.points[mesh.tets[t][std::size_t(k)]]; };
        const auto [i, j] = tet_edges[e];
        int other[2], n = 0;
        for (int k = 0; k < 4; ++k)
            if (k != i && k != j) other[n++] = k;
        const Vec3d axis = (p(j) - p(i)).normalized();
        const Vec3d u = p(other[0]) - p(i), v = p(other[1]) - p(i);
        const Vec3d a = u - axis.dot(u) * axis, b = v - axis.dot(v) * axis;
        angles[e] = std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / M_PI;
    }
    return angles;
}

struct Angles {
    double least = 180, most = 0;
    std::uint64_t outside = 0, turned_over = 0;
    /// As optimize_tets sees the worst angle: see DihedralBounds.
    double worth = 1e30;
};

Angles angles_of(const TetMesh& mesh, double low = 20, double high = 130) {
    Angles all;
    const auto half = [](double deg) { return deg * M_PI / 360; };
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const std::array<double, 6> a = dihedrals(mesh, t);
        const double least = *std::min_element(a.begin(), a.end()),
                     most = *std::max_element(a.begin(), a.end());
        all.least = std::min(all.least, least);
        all.most = std::max(all.most, most);
        all.outside += least < low || most > high;
        all.turned_over += !(tet_determinant(mesh, t) > 0);
        all.worth = std::min({all.worth, std::sin(half(least)) / std::sin(half(low)),
                              std::cos(half(most)) / std::cos(half(high))});
    }
    return all;
}

double volume(const TetMesh& mesh, std::int32_t region = 0) {
    double sum = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        if (region == 0 || mesh.region(t) == region) sum += tet_determinant(mesh, t) / 6;
    return sum;
}

using FaceKey = std::array<std::array<double, 3>, 3>;

/// Faces by the coordinates of their corners, turned so that the least one is first, and their regions.
std::multiset<std::pair<FaceKey, std::array<std::int32_t, 2>>> faces_of(const TetMesh& mesh) {
    std::multiset<std::pair<FaceKey, std::array<std::int32_t, 2>>> all;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        FaceKey key;
        for (std::size_t c = 0; c < 3; ++c) {
            const Vec3d& p = mesh.points[mesh.faces[f][c]];
            key[c] = {p.x(), p.y(), p.z()};
        }
        std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());
        all.insert({key, mesh.face_regions[f]});
    }
    return all;
}

bool same_bytes(const TetMesh& a, const TetMesh& b) {
    const auto same_points = [&] {
        for (std::size_t i = 0; i < a.points.size(); ++i)
            if (std::memcmp(a.points[i].data(), b.points[i].data(), 3 * sizeof(double)) != 0) return false;
        return true;
    };
    return a.points.size() == b.points.size() && same_points() && a.tets == b.tets &&
           a.regions == b.regions && a.faces == b.faces && a.face_regions == b.face_regions;
}

/// Every interior vertex pushed by up to `push` at random, where that turns nothing over.
TetMesh jittered(TetMesh mesh, double push, std::uint64_t seed) {
    std::set<VertexId> fixed;
    for (const Triangle& f : mesh.faces) fixed.insert(f.begin(), f.end());
    std::vector<std::vector<std::size_t>> stars(mesh.points.size());
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (const VertexId v : mesh.tets[t]) stars[v].push_back(t);
    std::mt19937_64 random(seed);
    const auto unit = [&] { return double(random() >> 11) * 0x1p-52 - 1; };
    for (VertexId v = 0; v < mesh.points.size(); ++v) {
        if (fixed.count(v)) continue;
        const Vec3d before = mesh.points[v];
        for (double size = push; size > 0.1 * push; size *= 0.7) {
            mesh.points[v] = before + size * Vec3d(unit(), unit(), unit());
            if (std::all_of(stars[v].begin(), stars[v].end(),
                            [&](std::size_t t) { return tet_determinant(mesh, t) > 0; }))
                break;
            mesh.points[v] = before;
        }
    }
    return mesh;
}

TetMesh coarse_ball() { return lattice_tets(ball, 1.1, 1.0 / 6); }

/// Region 2 is where z is above 0 (by centroids).
TetMesh two_halves() {
    TetMesh mesh = jittered(coarse_ball(), 0.06, 3);
    for (const Tetrahedron& t : mesh.tets) {
        double z = 0;
        for (const VertexId v : t) z += mesh.points[v].z();
        mesh.regions.push_back(z > 0 ? 2 : 1);
    }
    set_faces(mesh);
    return mesh;
}

}  // namespace

TEST(TetOptimize, NoRoundsAndGoodMeshesGiveTheInputBack) {
    TetMesh mesh = coarse_ball();
    mesh.tet_properties.push_back({"p", 1, std::vector<float>(mesh.tets.size(), 1.0f)});
    const TetMesh before = mesh;
    TetOptimizeOptions options;
    options.rounds = 0;
    const TetOptimizeReport none = optimize_tets(mesh, options);
    EXPECT_TRUE(same_bytes(mesh, before));
    EXPECT_EQ(mesh.tet_properties.size(), 1u);
    EXPECT_EQ(none.moves + none.flips, 0u);
    EXPECT_EQ(none.outside_before, angles_of(before).outside);
    EXPECT_EQ(none.outside_after, none.outside_before);
    EXPECT_GT(none.outside_before, 10u);

    options.rounds = 20;
    options.min_dihedral_deg = 0.99 * angles_of(before).least;
    options.max_dihedral_deg = 1.01 * angles_of(before).most;
    const TetOptimizeReport good = optimize_tets(mesh, options);
    EXPECT_TRUE(same_bytes(mesh, before));
    EXPECT_EQ(good.rounds, 0);
    EXPECT_EQ(good.outside_before, 0u);

    TetMesh empty;
    EXPECT_EQ(optimize_tets(empty).outside_before, 0u);
    EXPECT_TRUE(empty.empty());
}

TEST(TetOptimize, BringsSlidingSurfacesWithinTheBounds) {
    struct Case {
        double (*inside)(const Vec3d&);
        std::optional<Vec3d> (*onto)(const Vec3d&);
    };
    for (const Case& c : {Case{bumpy, onto_bumpy}, Case{torus, onto_torus}}) {
        TetMesh mesh = lattice_tets(c.inside, 1.2, 0.06);
        const Angles before = angles_of(mesh);
        ASSERT_EQ(before.turned_over, 0u);
        ASSERT_GT(before.outside, 100u);
        TetOptimizeOptions options;
        options.onto_surface = c.onto;
        const std::size_t points = mesh.points.size(), faces = mesh.faces.size();
        const double volume_before = volume(mesh);
        const TetOptimizeReport report = optimize_tets(mesh, options);
        const Angles after = angles_of(mesh);
        EXPECT_EQ(report.outside_before, before.outside);
        EXPECT_EQ(report.outside_after, 0u);
        EXPECT_EQ(after.outside, 0u);
        EXPECT_EQ(after.turned_over, 0u);
        EXPECT_GE(after.least, 20);
        EXPECT_LE(after.most, 130);
        EXPECT_EQ(mesh.points.size(), points);
        EXPECT_EQ(mesh.faces.size(), faces);
        EXPECT_NEAR(volume(mesh), volume_before, 2e-3 * volume_before);
        for (const Triangle& f : mesh.faces)
            for (const VertexId v : f) ASSERT_NEAR(c.inside(mesh.points[v]), 0, 1e-12);
        EXPECT_NO_THROW(tet_adjacency(mesh));
    }
}

TEST(TetOptimize, MovesOnlyWhatIsNearBadTetrahedra) {
    TetMesh mesh = coarse_ball();
    const TetMesh before = mesh;
    const TetOptimizeReport report = optimize_tets(mesh);
    std::size_t moved = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) moved += mesh.points[v] != before.points[v];
    EXPECT_GT(moved, 0u);
    EXPECT_LE(moved, 4 * report.outside_before);
}

TEST(TetOptimize, KeepsAFixedBoundaryToTheLastBit) {
    for (const double push : {0.0, 0.05, 0.1}) {
        TetMesh mesh = jittered(coarse_ball(), push, 1);
        const TetMesh before = mesh;
        const Angles bad = angles_of(before);
        const TetOptimizeReport report = optimize_tets(mesh);
        const Angles good = angles_of(mesh);
        EXPECT_EQ(faces_of(mesh), faces_of(before));
        EXPECT_NEAR(volume(mesh), volume(before), 1e-12);
        EXPECT_GT(good.worth, bad.worth);
        EXPECT_LT(good.outside, bad.outside / 20);
        EXPECT_EQ(good.outside, report.outside_after);
        EXPECT_EQ(good.turned_over, 0u);
        EXPECT_GT(report.flips, 0u);
        EXPECT_GT(report.moves, 0u);
        EXPECT_NO_THROW(tet_adjacency(mesh));
    }
}

TEST(TetOptimize, TheWorstNeverGetsWorse) {
    const TetMesh start = jittered(coarse_ball(), 0.12, 5);
    double worth = angles_of(start).worth;
    ASSERT_LT(worth, 0.3);
    std::uint64_t steps = 0;
    for (int rounds = 1; rounds < 5; ++rounds) {
        TetMesh mesh = start;
        TetOptimizeOptions options;
        options.rounds = rounds;
        const TetOptimizeReport report = optimize_tets(mesh, options);
        const double now = angles_of(mesh).worth;
        EXPECT_GE(now, worth * (1 - 1e-12)) << rounds;
        EXPECT_GE(report.moves + report.flips, steps);
        steps = report.moves + report.flips;
        worth = now;
    }
    EXPECT_GT(worth, 0.6);
}

TEST(TetOptimize, KeepsRegionsAndTheFacesBetweenThem) {
    TetMesh mesh = two_halves();
    const TetMesh before = mesh;
    TetOptimizeOptions options;
    optimize_tets(mesh, options);
    EXPECT_EQ(faces_of(mesh), faces_of(before));
    for (const std::int32_t region : {1, 2}) EXPECT_NEAR(volume(mesh, region), volume(before, region), 1e-12);

    // On the sliding boundary, what lies between the regions still stays.
    mesh = before;
    options.onto_surface = onto_ball;
    EXPECT_GT(optimize_tets(mesh, options).moves, 0u);
    EXPECT_LT(angles_of(mesh).outside, angles_of(before).outside / 4);
    std::size_t between = 0, slid = 0;
    for (std::size_t f = 0; f < before.faces.size(); ++f)
        for (const VertexId v : before.faces[f]) {
            between += before.face_regions[f][1] == 2;
            slid += mesh.points[v] != before.points[v];
            if (before.face_regions[f][1] == 2) {
                ASSERT_EQ(mesh.points[v], before.points[v]);
            }
        }
    EXPECT_GT(between, 100u);
    EXPECT_GT(slid, 10u);
    for (const std::int32_t region : {1, 2}) EXPECT_NEAR(volume(mesh, region), volume(before, region), 0.01);
}

TEST(TetOptimize, TheSameBytesForAnyNumberOfThreads) {
    for (const bool slides : {false, true}) {
        TetMesh one = jittered(lattice_tets(torus, 1.1, 0.08), 0.03, 9), two = one;
        TetOptimizeOptions options;
        if (slides) options.onto_surface = onto_torus;
        {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
            optimize_tets(one, options);
        }
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
        optimize_tets(two, options);
        EXPECT_TRUE(same_bytes(one, two));
    }
}

TEST(TetOptimize, WorksWithoutFlipsAndWithAFailingProjection) {
    TetMesh mesh = coarse_ball();
    const Angles before = angles_of(mesh);
    TetOptimizeOptions options;
    options.flips = false;
    const TetMesh start = mesh;
    EXPECT_EQ(optimize_tets(mesh, options).flips, 0u);
    EXPECT_LT(angles_of(mesh).outside, before.outside);
    EXPECT_EQ(mesh.tets, start.tets);

    mesh = start;  // a projection that finds nothing, or nonsense, leaves the boundary where it is
    options.onto_surface = [](const Vec3d& p) -> std::optional<Vec3d> {
        if (p.x() > 0.3) return std::nullopt;
        if (p.x() > -0.3) return Vec3d(Vec3d::Constant(std::nan("")));
        return Vec3d(100 * p);
    };
    optimize_tets(mesh, options);
    EXPECT_EQ(faces_of(mesh), faces_of(start));
}

TEST(TetOptimize, CancelledLeavesTheMeshAsItWas) {
    TetMesh mesh = jittered(coarse_ball(), 0.08, 4);
    const TetMesh before = mesh;
    for (const double at : {0.0, 0.02, 0.06}) {
        const Progress progress([&](double fraction) { return fraction < at; });
        EXPECT_THROW(optimize_tets(mesh, {}, progress), Cancelled);
        EXPECT_TRUE(same_bytes(mesh, before));
    }
    double last = 0;
    bool forward = true;
    optimize_tets(mesh, {}, Progress([&](double fraction) {
                      forward = forward && fraction >= last;
                      last = fraction;
                      return true;
                  }));
    EXPECT_TRUE(forward);
    EXPECT_EQ(last, 1);
}

TEST(TetOptimize, RefusesWhatIsNoMesh) {
    const TetMesh good = coarse_ball();
    TetMesh mesh = good;
    std::swap(mesh.tets[7][0], mesh.tets[7][1]);
    EXPECT_THROW(optimize_tets(mesh), InvalidInput);
    mesh = good;
    mesh.tets[3][2] = VertexId(mesh.points.size());
    EXPECT_THROW(optimize_tets(mesh), InvalidInput);
    mesh = good;
    mesh.tets.push_back(mesh.tets[5]);  // on top of another
    EXPECT_THROW(optimize_tets(mesh), InvalidInput);
    mesh = good;
    mesh.points[5].x() = std::nan("");
    EXPECT_THROW(optimize_tets(mesh), InvalidInput);
    mesh = good;
    for (const auto& [low, high, rounds] :
         {std::tuple{0.0, 130.0, 5}, std::tuple{75.0, 130.0, 5}, std::tuple{20.0, 180.0, 5},
          std::tuple{20.0, 60.0, 5}, std::tuple{std::nan(""), 130.0, 5}, std::tuple{20.0, 130.0, -1}}) {
        TetOptimizeOptions options;
        options.min_dihedral_deg = low, options.max_dihedral_deg = high, options.rounds = rounds;
        EXPECT_THROW(optimize_tets(mesh, options), InvalidInput);
    }
    EXPECT_TRUE(same_bytes(mesh, good));
}

TEST(TetOptimize, BringsAStuffedMapWithinTheBounds) {
    // Smooth lumps of the size of a few voxels, cut by the box.
    const Frame frame = centred_frame(40, 1.3);
    const DensityMap map = map_from_function({40, 40, 40}, frame, [](const Vec3d& p) {
        return std::sin(0.45 * p.x()) * std::cos(0.4 * p.y() + 0.3) + std::sin(0.5 * p.z() + 0.2 * p.x());
    });
    TetMesh mesh = isosurface_stuffing(map, 0.3);
    const Angles before = angles_of(mesh);
    ASSERT_GT(before.outside, 100u);
    TetOptimizeOptions options;
    options.onto_surface = map_projection(map, 0.3);
    optimize_tets(mesh, options);
    const Angles after = angles_of(mesh);
    EXPECT_EQ(after.outside, 0u);
    EXPECT_EQ(after.turned_over, 0u);
    const Vec3d corner = Vec3d::Constant(0.5 * 39 * 1.3 + 1e-9);
    for (const Vec3d& p : mesh.points) ASSERT_TRUE((p.cwiseAbs().array() <= corner.array()).all());
}

TEST(TetOptimize, BringsARealMapWithinTheBounds) {
    VDBGEO_NEEDS_DATA("mainmastseg/MAP_m4A.mrc.gz");
    const DensityMap map = read_map(data_folder() / "mainmastseg/MAP_m4A.mrc.gz").map;
    TetMesh mesh = isosurface_stuffing(map, 0.7);
    ASSERT_GT(angles_of(mesh).outside, 1000u);
    TetOptimizeOptions options;
    options.onto_surface = map_projection(map, 0.7);
    optimize_tets(mesh, options);
    const Angles after = angles_of(mesh);
    EXPECT_EQ(after.outside, 0u);
    EXPECT_EQ(after.turned_over, 0u);
}
