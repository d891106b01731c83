#include "vdbgeo/tet/delaunay_tetrahedra.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "converters/map_file.h"
#include "tests/support/data.h"
#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/cap.h"
#include "vdbgeo/surface/marching_cubes.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::map_from_function;
using Options = DelaunayTetrahedraOptions;

class DelaunayTetrahedra : public testing::Test {
 protected:
    void SetUp() override {
        openvdb::initialize();
        if (!have_delaunay_tetrahedra()) GTEST_SKIP() << "this build has no CGAL";
    }
};

double ball(const Vec3d& p, const Vec3d& centre, double radius) { return radius - (p - centre).norm(); }

DensityMap sphere_map(double radius, int n = 40) {
    return map_from_function({n, n, n}, centred_frame(n, 1),
                             [&](const Vec3d& p) { return ball(p, Vec3d(0.3, -0.2, 0.1), radius); });
}

std::map<std::int32_t, double> volumes(const TetMesh& mesh) {
    std::map<std::int32_t, double> out;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) out[mesh.region(t)] += tet_determinant(mesh, t) / 6;
    return out;
}
double volume(const TetMesh& mesh) {
    double sum = 0;
    for (const auto& [region, v] : volumes(mesh)) sum += v;
    return sum;
}

/// The area between two regions; the second may be 0.
double area_between(const TetMesh& mesh, std::int32_t a, std::int32_t b) {
    double area = 0;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto [in, out] = mesh.face_regions[f];
        if (!((in == a && out == b) || (in == b && out == a))) continue;
        const Triangle& t = mesh.faces[f];
        area +=
            0.5 * (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]).norm();
    }
    return area;
}

struct Shape {
    double radius_edge = 0, largest_radius = 0, least_dihedral = 180;
};
Shape shape_of(const TetMesh& mesh) {
    Shape out;
    for (const Tetrahedron& tet : mesh.tets) {
        std::array<Vec3d, 4> p, n;
        for (std::size_t k = 0; k < 4; ++k) p[k] = mesh.points[tet[k]];
        const Vec3d u = p[1] - p[0], v = p[2] - p[0], w = p[3] - p[0];
        const double radius =
            ((u.squaredNorm() * v.cross(w) + v.squaredNorm() * w.cross(u) + w.squaredNorm() * u.cross(v)) /
             (2 * u.dot(v.cross(w))))
                .norm();
        double shortest = radius * 2;
        for (std::size_t a = 0; a < 4; ++a)
            for (std::size_t b = 0; b < a; ++b) shortest = std::min(shortest, (p[a] - p[b]).norm());
        out.radius_edge = std::max(out.radius_edge, radius / shortest);
        out.largest_radius = std::max(out.largest_radius, radius);
        for (std::size_t k = 0; k < 4; ++k) {
            const auto& f = tet_faces[k];
            const auto at = [&](std::size_t i) { return p[static_cast<std::size_t>(f[i])]; };
            n[k] = (at(1) - at(0)).cross(at(2) - at(0)).normalized();
        }
        for (std::size_t a = 0; a < 4; ++a)
            for (std::size_t b = 0; b < a; ++b)
                out.least_dihedral =
                    std::min(out.least_dihedral,
                             180 - std::atan2(n[a].cross(n[b]).norm(), n[a].dot(n[b])) * 180 / M_PI);
    }
    return out;
}

/// What every result promises.
void expect_sound(const TetMesh& mesh) {
    ASSERT_FALSE(mesh.empty());
    check(mesh, "result");
    EXPECT_NO_THROW(tet_adjacency(mesh));
    std::vector<bool> used(mesh.points.size(), false);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        ASSERT_GT(tet_determinant(mesh, t), 0);
        for (const VertexId v : mesh.tets[t]) used[v] = true;
    }
    EXPECT_EQ(std::count(used.begin(), used.end(), false), 0);
    TetMesh again = mesh;
    set_faces(again);
    EXPECT_EQ(again.faces, mesh.faces);
    EXPECT_EQ(again.face_regions, mesh.face_regions);
}

TriMesh closed_cubes(const DensityMap& map, double isovalue) {
    MarchingCubesOptions cubes;
    cubes.isovalue = isovalue;
    return cap_border(marching_cubes(map, cubes), map, isovalue);
}

TEST_F(DelaunayTetrahedra, FillASphereWithinTheBounds) {
    const DensityMap map = sphere_map(15);
    const Options options;
    const TetMesh mesh = delaunay_tetrahedra(map, 0, options);
    expect_sound(mesh);
    EXPECT_TRUE(mesh.regions.empty());
    const double cubes = *measure_mesh(closed_cubes(map, 0)).volume_A3;
    EXPECT_NEAR(volume(mesh), cubes, 0.01 * cubes);

    const TriMesh surface = boundary_surface(mesh);
    const MeshMeasures m = measure_mesh(surface);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GE(m.min_angle_deg, options.facet_angle_deg - 1e-3);
    const Shape shape = shape_of(mesh);
    EXPECT_LE(shape.radius_edge, options.cell_radius_edge + 1e-6);
    EXPECT_LE(shape.largest_radius, options.cell_size + 1e-6);
    const Vec3d centre(0.3, -0.2, 0.1);
    for (const Triangle& t : mesh.faces) {
        for (const VertexId v : t) ASSERT_NEAR((mesh.points[v] - centre).norm(), 15, 0.05);
        const Vec3d u = mesh.points[t[1]] - mesh.points[t[0]], v = mesh.points[t[2]] - mesh.points[t[0]],
                    n = u.cross(v);
        const Vec3d circum =
            (u.squaredNorm() * v.cross(n) + v.squaredNorm() * n.cross(u)) / (2 * n.squaredNorm());
        EXPECT_LE(circum.norm(), options.facet_size + 1e-6);
        // The ball's centre is the point of the sphere above the circumcentre.
        ASSERT_GE((mesh.points[t[0]] + circum - centre).norm(), 15 - options.facet_distance - 0.05);
    }
}

TEST_F(DelaunayTetrahedra, FillATorusInASkewedFrame) {
    Frame frame;
    frame.axes << 1, 0.3, 0, 0, 1.2, 0.1, 0, 0, 0.8;
    frame.origin = -frame.axes * Vec3d(30, 25, 15) + Vec3d(1000, -2000, 500);
    const DensityMap map = map_from_function({61, 51, 31}, frame, [](const Vec3d& world) {
        const Vec3d p = world - Vec3d(1000, -2000, 500);
        return 4 - std::hypot(std::hypot(p.x(), p.y()) - 12, p.z());
    });
    const TetMesh mesh = delaunay_tetrahedra(map, 0);
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(boundary_surface(mesh));
    EXPECT_TRUE(m.closed && m.manifold);
    EXPECT_EQ(m.genus, 1);
    EXPECT_NEAR(volume(mesh), 2 * M_PI * M_PI * 12 * 16, 0.03 * 2 * M_PI * M_PI * 12 * 16);
    EXPECT_LE(shape_of(mesh).radius_edge, 2 + 1e-6);
}

TEST_F(DelaunayTetrahedra, FinerBoundsComeNearerToTheShape) {
    const double tube = 6, truth = 2 * M_PI * M_PI * 15 * tube * tube;
    const DensityMap map = map_from_function({48, 48, 20}, {}, [&](const Vec3d& p) {
        return tube - std::hypot(std::hypot(p.x() - 23.6, p.y() - 23.3) - 15, p.z() - 9.4);
    });
    Options fine;
    fine.facet_distance = 0.05;
    const double coarse = volume(delaunay_tetrahedra(map, 0)),
                 near = volume(delaunay_tetrahedra(map, 0, fine));
    EXPECT_NEAR(near, truth, 0.01 * truth);
    EXPECT_LT(std::abs(near - truth), std::abs(coarse - truth));
}

TEST_F(DelaunayTetrahedra, MissNoSmallSphereBesideALargeOne) {
    for (const double radius : {0.7, 1.2, 2.5}) {
        const DensityMap map = map_from_function({50, 40, 40}, {}, [&](const Vec3d& p) {
            return std::max(ball(p, Vec3d(16, 20, 20), 13), ball(p, Vec3d(41.4, 20.3, 19.8), radius));
        });
        Options options;
        options.facet_size = options.cell_size = 4;
        const TetMesh mesh = delaunay_tetrahedra(map, 0, options);
        expect_sound(mesh);
        const MeshMeasures m = measure_mesh(boundary_surface(mesh));
        EXPECT_EQ(m.components, 2u) << radius;
        EXPECT_TRUE(m.closed && m.manifold);
    }
}

TEST_F(DelaunayTetrahedra, LeaveACavityEmpty) {
    const DensityMap map = map_from_function({40, 40, 40}, centred_frame(40, 1),
                                             [](const Vec3d& p) { return 5 - std::abs(p.norm() - 11); });
    const TetMesh mesh = delaunay_tetrahedra(map, 0);
    expect_sound(mesh);
    EXPECT_EQ(measure_mesh(boundary_surface(mesh)).components, 2u);
    const double shell = 4 * M_PI / 3 * (16 * 16 * 16 - 6 * 6 * 6);
    EXPECT_NEAR(volume(mesh), shell, 0.02 * shell);
}

TEST_F(DelaunayTetrahedra, AreClosedAtTheBorderOfTheBox) {
    const DensityMap map =
        map_from_function({40, 40, 20}, {}, [](const Vec3d& p) { return ball(p, Vec3d(19.6, 19.3, 0), 12); });
    const TetMesh mesh = delaunay_tetrahedra(map, 0);
    expect_sound(mesh);
    EXPECT_NEAR(volume(mesh), 2 * M_PI / 3 * 1728, 0.03 * 2 * M_PI / 3 * 1728);
    for (const Vec3d& p : mesh.points) ASSERT_GE(p.z(), -1e-4);
}

TEST_F(DelaunayTetrahedra, OfAMapThatIsInsideAllOverFillItsBox) {
    const DensityMap map = map_from_function({12, 10, 14}, {}, [](const Vec3d&) { return 1.0; });
    const TetMesh mesh = delaunay_tetrahedra(map, 0.5);
    expect_sound(mesh);
    EXPECT_NEAR(volume(mesh), 11 * 9 * 13, 0.05 * 11 * 9 * 13);
}

TEST_F(DelaunayTetrahedra, FillOneVoxel) {
    for (const double isovalue : {0.02, 0.5, 0.98, 1.0}) {
        const DensityMap map =
            map_from_function({9, 9, 9}, {}, [](const Vec3d& p) { return p == Vec3d(4, 4, 4) ? 1.0 : 0.0; });
        const TetMesh mesh = delaunay_tetrahedra(map, isovalue);
        expect_sound(mesh);
        EXPECT_EQ(measure_mesh(boundary_surface(mesh)).components, 1u) << isovalue;
    }
}

TEST_F(DelaunayTetrahedra, MissFewPiecesOfNoise) {
    const DensityMap map = test::map_from_values({12, 12, 12}, test::noise(1728, 11));
    const TetMesh mesh = delaunay_tetrahedra(map, 0.8);
    expect_sound(mesh);
    const TriMesh cubes = closed_cubes(map, 0.8);
    const MeshMeasures reference = measure_mesh(cubes), m = measure_mesh(boundary_surface(mesh));
    EXPECT_GT(reference.components, 50u);
    // Those that touch through a neck of a hundredth of a voxel may be parted or joined.
    EXPECT_NEAR(static_cast<double>(m.components), static_cast<double>(reference.components),
                0.15 * static_cast<double>(reference.components));
}

TEST_F(DelaunayTetrahedra, FollowASizeField) {
    Options options;
    options.facet_size = options.cell_size = 5;
    options.facet_distance = 1;
    options.size = [](const Vec3d& p) { return p.x() < 0 ? 2.0 : 5.0; };
    const TetMesh mesh = delaunay_tetrahedra(sphere_map(17), 0, options);
    expect_sound(mesh);
    std::array<double, 2> sum{}, count{};
    for (const Tetrahedron& t : mesh.tets)
        for (const auto& [a, b] : tet_edges) {
            const Vec3d &p = mesh.points[t[static_cast<std::size_t>(a)]],
                        &q = mesh.points[t[static_cast<std::size_t>(b)]];
            if (std::abs(p.x() + q.x()) < 8) continue;
            const std::size_t side = p.x() + q.x() > 0;
            sum[side] += (p - q).norm();
            count[side] += 1;
        }
    EXPECT_NEAR(sum[0] / count[0], 2, 0.4);
    EXPECT_NEAR(sum[1] / count[1], 5, 1.2);
}

TEST_F(DelaunayTetrahedra, OptimisersTakeTheSliversAway) {
    Options options;
    options.perturb = options.exude = true;
    const DensityMap torus = map_from_function({48, 48, 20}, {}, [&](const Vec3d& p) {
        return 6 - std::hypot(std::hypot(p.x() - 23.6, p.y() - 23.3) - 15, p.z() - 9.4);
    });
    for (const DensityMap& map : {sphere_map(15), torus}) {
        const TetMesh plain = delaunay_tetrahedra(map, 0), better = delaunay_tetrahedra(map, 0, options);
        expect_sound(better);
        EXPECT_LT(shape_of(plain).least_dihedral, 8);
        EXPECT_GT(shape_of(better).least_dihedral, 10);
        EXPECT_NEAR(volume(better), volume(plain), 0.005 * volume(plain));
        const MeshMeasures m = measure_mesh(boundary_surface(better));
        EXPECT_TRUE(m.closed && m.oriented);
    }
    Options smooth;
    smooth.facet_size = smooth.cell_size = 3;
    const double before = volume(delaunay_tetrahedra(sphere_map(15), 0, smooth));
    smooth.lloyd = smooth.odt = true;
    const TetMesh mesh = delaunay_tetrahedra(sphere_map(15), 0, smooth);
    expect_sound(mesh);
    EXPECT_NEAR(volume(mesh), before, 0.02 * before);
}

/// Labels 3 and 7: the lower and the upper half of a ball.
DensityMap half_balls(double radius) {
    return map_from_function({44, 44, 44}, {}, [&](const Vec3d& p) {
        return ball(p, Vec3d(21.3, 21.6, 21.2), radius) < 0 ? 0.0 : p.z() < 21.5 ? 3.0 : 7.0;
    });
}

TEST_F(DelaunayTetrahedra, OfTwoHalfBallsShareTheirInterface) {
    const double r = 16.4, low = 0.3;  // the plane is this far above the centre
    const TetMesh mesh = delaunay_tetrahedra_of_labels(half_balls(r));
    expect_sound(mesh);
    const auto v = volumes(mesh);
    ASSERT_EQ(v.size(), 2u);
    const double cap = M_PI * (r - low) * (r - low) * (2 * r + low) / 3, all = 4 * M_PI / 3 * r * r * r;
    EXPECT_NEAR(v.at(7), cap, 0.015 * cap);
    EXPECT_NEAR(v.at(3), all - cap, 0.015 * (all - cap));
    const double disc = M_PI * (r * r - low * low);
    EXPECT_NEAR(area_between(mesh, 3, 7), disc, 0.025 * disc);
    EXPECT_NEAR(area_between(mesh, 7, 0), 2 * M_PI * r * (r - low), 0.03 * 2 * M_PI * r * (r - low));
    EXPECT_NEAR(area_between(mesh, 3, 0), 2 * M_PI * r * (r + low), 0.03 * 2 * M_PI * r * (r + low));
}

TEST_F(DelaunayTetrahedra, OfThirtyLabelsMissNone) {
    // Two that touch, and 28 of one to eight voxels each.
    const DensityMap map = map_from_function({40, 40, 40}, {}, [](const Vec3d& p) {
        if (ball(p, Vec3d(12, 20, 20), 7) >= 0) return 1.0;
        if (ball(p, Vec3d(24, 20, 20), 7) >= 0) return 2.0;
        for (int n = 0; n < 28; ++n) {
            const Vec3d low(3 + 5 * (n % 7), 3 + 9 * (n / 7 % 2), n < 14 ? 3 : 34);
            const Vec3d d = p - low;
            if (d.minCoeff() < 0 || d.maxCoeff() > 1) continue;
            const int voxel = static_cast<int>(d.x() + 2 * d.y() + 4 * d.z());
            if (voxel <= n % 8) return 3.0 + n;
        }
        return 0.0;
    });
    const TetMesh mesh = delaunay_tetrahedra_of_labels(map);
    expect_sound(mesh);
    const auto v = volumes(mesh);
    EXPECT_EQ(v.size(), 30u);
    for (const auto& [label, size] : v) {
        const double voxels = label < 3 ? 4 * M_PI / 3 * 343 : (label - 3) % 8 + 1;
        EXPECT_GT(size, (label < 3 ? 0.9 : 0.05) * voxels) << label;
        EXPECT_LT(size, 1.1 * voxels) << label;
    }
    EXPECT_GT(area_between(mesh, 1, 2), 20);

    const TetMesh some = delaunay_tetrahedra_of_labels(map, {2, 9});
    expect_sound(some);
    const auto w = volumes(some);
    ASSERT_EQ(w.size(), 2u);
    EXPECT_NEAR(w.at(2), v.at(2), 0.03 * v.at(2));
    EXPECT_EQ(area_between(some, 1, 2), 0);
}

TEST_F(DelaunayTetrahedra, KeepLabelsOfOneVoxelsThickness) {
    // A membrane of one voxel between two regions.
    const DensityMap map = map_from_function({24, 24, 24}, {}, [](const Vec3d& p) {
        const double d = (p - Vec3d(11.5, 11.5, 11.5)).norm();
        return d > 9 ? 0.0 : d > 8 ? 1.0 : 2.0;
    });
    const TetMesh mesh = delaunay_tetrahedra_of_labels(map);
    expect_sound(mesh);
    EXPECT_GT(volumes(mesh).at(1), 0.4 * 4 * M_PI * 8.5 * 8.5);
    // Some leaks in a voxelised shell.
    EXPECT_LT(area_between(mesh, 2, 0), 0.1 * 4 * M_PI * 64);
}

TEST_F(DelaunayTetrahedra, OfLabelsRefuseWhatIsNone) {
    const DensityMap map = half_balls(6);
    EXPECT_THROW(delaunay_tetrahedra_of_labels(map, {3, 5}), InvalidInput);
    EXPECT_THROW(delaunay_tetrahedra_of_labels(map, {0}), InvalidInput);
    EXPECT_THROW(delaunay_tetrahedra_of_labels(map, {-3}), InvalidInput);
    EXPECT_THROW(delaunay_tetrahedra_of_labels(sphere_map(6)), InvalidInput);
    const DensityMap none = map_from_function({5, 5, 5}, {}, [](const Vec3d&) { return 0.0; });
    EXPECT_THROW(delaunay_tetrahedra_of_labels(none), InvalidInput);
}

TEST_F(DelaunayTetrahedra, OfRealLabelsMissNone) {
    for (const char* name : {"pyto/labels.mrc", "sfftk/merged_mask.mrc"}) {
        VDBGEO_NEEDS_DATA(name);
        const DensityMap map = read_map(test::data_folder() / name).map;
        std::set<std::int32_t> expected, found;
        for (auto it = map.grid->cbeginValueAll(); it; ++it)
            if (*it > 0) expected.insert(static_cast<std::int32_t>(*it));
        Options options;
        options.facet_size = options.cell_size = 4;
        options.facet_distance = 0.5;
        const TetMesh mesh = delaunay_tetrahedra_of_labels(map, {}, options);
        expect_sound(mesh);
        for (std::size_t t = 0; t < mesh.tets.size(); ++t) found.insert(mesh.region(t));
        EXPECT_EQ(found, expected) << name;
    }
}

TEST_F(DelaunayTetrahedra, FillAClosedSurface) {
    const TriMesh surface = closed_cubes(sphere_map(12), 0);
    Options options;
    options.facet_size = options.cell_size = 1.5;
    options.facet_distance = 0.1;
    const TetMesh mesh = delaunay_tetrahedra(surface, options);
    expect_sound(mesh);
    const MeshMeasures m = measure_mesh(surface), back = measure_mesh(boundary_surface(mesh));
    EXPECT_NEAR(volume(mesh), *m.volume_A3, 0.01 * *m.volume_A3);
    EXPECT_TRUE(back.closed && back.manifold);
    EXPECT_EQ(back.components, 1u);

    TriMesh open = surface;
    open.triangles.pop_back();
    EXPECT_THROW(delaunay_tetrahedra(open), InvalidInput);
    EXPECT_THROW(delaunay_tetrahedra(TriMesh{}), InvalidInput);
}

TEST_F(DelaunayTetrahedra, FillACubeWithSharpEdges) {
    TriMesh cube;
    for (int k = 0; k < 8; ++k)
        cube.points.emplace_back(10.0f * static_cast<float>(k & 1), 10.0f * static_cast<float>(k >> 1 & 1),
                                 10.0f * static_cast<float>(k >> 2));
    for (const Triangle& t : std::vector<Triangle>{{0, 2, 1},
                                                   {1, 2, 3},
                                                   {4, 5, 6},
                                                   {5, 7, 6},
                                                   {0, 1, 4},
                                                   {1, 5, 4},
                                                   {2, 6, 3},
                                                   {3, 6, 7},
                                                   {0, 4, 2},
                                                   {2, 4, 6},
                                                   {1, 3, 5},
                                                   {3, 7, 5}})
        cube.triangles.push_back(t);
    Options options;
    options.facet_size = options.cell_size = 0.2;
    options.facet_distance = 0.02;
    const TetMesh mesh = delaunay_tetrahedra(cube, options);
    expect_sound(mesh);
    EXPECT_NEAR(volume(mesh), 1000, 15);
}

bool same_bytes(const TetMesh& a, const TetMesh& b) {
    return a.points.size() == b.points.size() && a.tets == b.tets && a.regions == b.regions &&
           a.faces == b.faces &&
           std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3d)) == 0;
}

TEST_F(DelaunayTetrahedra, AreTheSameBytesAgainAndForAnyThreads) {
    const DensityMap map = map_from_function({30, 30, 30}, centred_frame(30, 2), [](const Vec3d& p) {
        return std::sin(p.x() / 5) + std::sin(p.y() / 6) + std::sin(p.z() / 7);
    });
    Options options;
    options.perturb = options.exude = options.odt = true;
    TetMesh first, second;
    test::with_threads(1, [&] { first = delaunay_tetrahedra(map, 0.7, options); });
    const std::vector<std::vector<char>> shifted_memory(1000, std::vector<char>(777));
    test::with_threads(2, [&] { second = delaunay_tetrahedra(map, 0.7, options); });
    EXPECT_TRUE(same_bytes(first, second));
    const DensityMap labels = half_balls(9);
    test::with_threads(1, [&] { first = delaunay_tetrahedra_of_labels(labels); });
    test::with_threads(2, [&] { second = delaunay_tetrahedra_of_labels(labels); });
    EXPECT_TRUE(same_bytes(first, second));
}

TEST_F(DelaunayTetrahedra, InParallelAreSoundToo) {
    Options options;
    options.parallel = true;
    const DensityMap map = sphere_map(15);
    const double cubes = *measure_mesh(closed_cubes(map, 0)).volume_A3;
    for (const bool optimise : {false, true}) {
        options.perturb = options.exude = options.odt = optimise;
        const TetMesh mesh = delaunay_tetrahedra(map, 0, options);
        expect_sound(mesh);
        EXPECT_NEAR(volume(mesh), cubes, 0.01 * cubes);
        if (optimise) {
            EXPECT_GT(shape_of(mesh).least_dihedral, 5);
        }
    }
    options.perturb = options.exude = options.odt = false;
    const TetMesh labels = delaunay_tetrahedra_of_labels(half_balls(12), {}, options);
    expect_sound(labels);
    EXPECT_EQ(volumes(labels).size(), 2u);
}

TEST_F(DelaunayTetrahedra, NeedSomethingThatCrosses) {
    const DensityMap empty = map_from_function({9, 9, 9}, {}, [](const Vec3d&) { return 0.0; });
    EXPECT_THROW(delaunay_tetrahedra(empty, 0.5), NumericalError);
    auto grid = openvdb::FloatGrid::create(1);
    grid->tree().setValue(openvdb::Coord(0), -1);
    DensityMap endless;
    endless.grid = grid;
    EXPECT_THROW(delaunay_tetrahedra(endless, 0), InvalidInput);
    EXPECT_THROW(delaunay_tetrahedra(sphere_map(5), std::nan("")), InvalidInput);
}

TEST_F(DelaunayTetrahedra, CapsEndThem) {
    for (const bool parallel : {false, true}) {
        Options few;
        few.parallel = parallel;
        few.max_vertices = 500;
        try {
            delaunay_tetrahedra(sphere_map(15), 0, few);
            FAIL();
        } catch (const NumericalError& e) {
            EXPECT_NE(std::string(e.what()).find("500 vertices"), std::string::npos) << e.what();
        }
        Options soon;
        soon.parallel = parallel;
        soon.facet_size = soon.cell_size = 0.3;
        soon.max_seconds = 0.05;
        try {
            delaunay_tetrahedra(sphere_map(15), 0, soon);
            FAIL();
        } catch (const NumericalError& e) {
            EXPECT_NE(std::string(e.what()).find("0.05 s"), std::string::npos) << e.what();
        }
    }
}

TEST_F(DelaunayTetrahedra, CanBeCancelled) {
    for (const bool parallel : {false, true})
        for (const double at : {0.05, 0.15, 0.6}) {
            Options options;
            options.parallel = parallel;
            options.perturb = options.exude = true;
            std::atomic<int> late{0};
            const Progress stop([&](double fraction) {
                late += fraction >= at;
                return fraction < at;
            });
            EXPECT_THROW(delaunay_tetrahedra(sphere_map(15), 0, options, stop), Cancelled) << parallel << at;
            EXPECT_GE(late, 1);
        }
}

TEST_F(DelaunayTetrahedra, RefuseBadOptions) {
    const auto refused = [&](auto change) {
        Options options;
        change(options);
        EXPECT_THROW(delaunay_tetrahedra(sphere_map(4, 12), 0, options), InvalidInput);
        EXPECT_THROW(delaunay_tetrahedra_of_labels(half_balls(3), {}, options), InvalidInput);
        EXPECT_THROW(delaunay_tetrahedra(TriMesh{}, options), InvalidInput);
    };
    refused([](auto& o) { o.facet_angle_deg = 31; });
    refused([](auto& o) { o.facet_angle_deg = -1; });
    refused([](auto& o) { o.facet_size = 0; });
    refused([](auto& o) { o.facet_size = std::nan(""); });
    refused([](auto& o) { o.facet_distance = 0; });
    refused([](auto& o) { o.cell_radius_edge = 0.9; });
    refused([](auto& o) { o.cell_size = -2; });
    refused([](auto& o) { o.sliver_bound_deg = 90; });
    refused([](auto& o) { o.max_vertices = 3; });
    refused([](auto& o) { o.max_seconds = 0; });
}

}  // namespace
}  // namespace vdbgeo
