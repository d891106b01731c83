// Marching cubes: analytic shapes, manifoldness and determinism. The topology of ambiguous cells has an
// oracle of its own in topology_test.cpp.
#include "vdbgeo/surface/marching_cubes.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

double sphere(const Vec3d& p) { return 1 - p.norm(); }

DensityMap sphere_map(double h, const SparsifyOptions& options = {}) {
    const int n = static_cast<int>(std::ceil(2.4 / h));
    return map_from_function(Vec3i(n, n, n), centred_frame(n, h), sphere, options);
}

TriMesh extract(const DensityMap& map, double isovalue = 0) { return marching_cubes(map, {isovalue}); }

bool same(const TriMesh& a, const TriMesh& b) {
    return a.points.size() == b.points.size() && a.triangles.size() == b.triangles.size() &&
           std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3f)) == 0 &&
           std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)) == 0;
}

}  // namespace

TEST(MarchingCubes, ASphereIsClosedManifoldAndFacesOutward) {
    const MeshMeasures m = measure_mesh(extract(sphere_map(0.1)));
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    ASSERT_TRUE(m.volume_A3);
    EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.03);  // positive: normals point from dense to empty
}

TEST(MarchingCubes, AreaAndVolumeConvergeAtSecondOrder) {
    double area_error[3], volume_error[3];
    for (int k = 0; k < 3; ++k) {
        const MeshMeasures m = measure_mesh(extract(sphere_map(0.1 / (1 << k))));
        area_error[k] = std::abs(m.area_A2 - 4 * M_PI);
        volume_error[k] = std::abs(*m.volume_A3 - 4.0 / 3 * M_PI);
    }
    for (int k = 0; k < 2; ++k) {
        EXPECT_GT(std::log2(area_error[k] / area_error[k + 1]), 1.9);
        EXPECT_GT(std::log2(volume_error[k] / volume_error[k + 1]), 1.9);
    }
}

TEST(MarchingCubes, ATorusHasOneHandle) {
    const auto torus = [](const Vec3d& p) { return 0.35 - std::hypot(std::hypot(p.x(), p.y()) - 1, p.z()); };
    const MeshMeasures m =
        measure_mesh(extract(map_from_function(Vec3i(60, 60, 60), centred_frame(60, 0.05), torus)));
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.genus, 1);
    EXPECT_NEAR(m.area_A2, 4 * M_PI * M_PI * 0.35, 0.05);
}

TEST(MarchingCubes, NoiseGivesAManifoldThatIsOpenAtTheBorderOnly) {
    const int n = 64;
    const DensityMap map = map_from_values(Vec3i(n, n, n), noise(n * n * n, 1));
    const TriMesh mesh = extract(map);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_GT(m.faces, 800000u);
    EXPECT_EQ(m.non_manifold_edges, 0u);
    EXPECT_EQ(m.non_manifold_vertices, 0u);
    EXPECT_EQ(m.misoriented_edges, 0u);
    EXPECT_EQ(m.degenerate_faces, 0u);
    EXPECT_EQ(m.unused_vertices, 0u);
    EXPECT_GT(m.boundary_edges, 0u);
    // The same field with an empty rim has no border to meet.
    std::vector<float> values = noise(n * n * n, 1);
    for (int i = 0; i < n * n * n; ++i) {
        const int x = i % n, y = i / n % n, z = i / n / n;
        if (std::min({x, y, z}) == 0 || std::max({x, y, z}) == n - 1)
            values[static_cast<std::size_t>(i)] = -1;
    }
    const MeshMeasures closed = measure_mesh(extract(map_from_values(Vec3i(n, n, n), values)));
    EXPECT_TRUE(closed.closed && closed.manifold && closed.oriented);
}

TEST(MarchingCubes, NoiseHasNoFacesThatCutEachOther) {
    if (!have_self_intersections()) GTEST_SKIP() << "built without CGAL";
    const int n = 12;
    for (std::uint64_t seed = 1; seed <= 150; ++seed) {
        const TriMesh mesh = extract(map_from_values(Vec3i(n, n, n), noise(n * n * n, seed)));
        ASSERT_GT(mesh.triangles.size(), 4000u);
        EXPECT_TRUE(self_intersections(mesh).empty()) << "seed " << seed;
    }
}

TEST(MarchingCubes, SameBytesForAnyNumberOfThreads) {
    const DensityMap map = map_from_values(Vec3i(50, 41, 67), noise(50 * 41 * 67, 2));
    const auto with = [&](std::size_t threads) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return extract(map, 0.1);
    };
    const TriMesh one = with(1);
    EXPECT_TRUE(same(one, with(2)));
    EXPECT_TRUE(same(one, with(7)));
}

TEST(MarchingCubes, ASparseGridGivesTheDenseGridsSurface) {
    const TriMesh dense = extract(sphere_map(0.05));
    SparsifyOptions band;
    band.threshold = 0;
    band.band = 0.2f;
    EXPECT_TRUE(same(dense, extract(sphere_map(0.05, band))));
    SparsifyOptions above;
    above.threshold = -0.15f;
    EXPECT_TRUE(same(dense, extract(sphere_map(0.05, above))));
}

TEST(MarchingCubes, ShiftingTheFieldAcrossLeavesShiftsTheSurface) {
    const auto blob = [](const Vec3d& p) {
        return 5.3 - (p - Vec3d(9.2, 8.1, 10.7)).norm() + 0.4 * std::sin(p.x() * p.y());
    };
    const MeshMeasures reference = measure_mesh(extract(map_from_function(Vec3i(32, 32, 32), {}, blob)));
    for (int s = 1; s < 8; ++s) {
        const Vec3d shift(s, s, s);
        const auto shifted = [&](const Vec3d& p) { return blob(p - shift); };
        const MeshMeasures m = measure_mesh(extract(map_from_function(Vec3i(40, 40, 40), {}, shifted)));
        EXPECT_EQ(m.faces, reference.faces);
        EXPECT_EQ(m.euler_characteristic, reference.euler_characteristic);
        EXPECT_NEAR(m.area_A2, reference.area_A2, 1e-4);
    }
}

TEST(MarchingCubes, AnUnboundedGridIsClosedAcrossMissingLeavesAndTiles) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(0.0f);
    map.grid->tree().addTile(1, openvdb::Coord(-8, 0, 8), 1.0f, true);   // 8³
    map.grid->tree().addTile(2, openvdb::Coord(128, 0, 0), 1.0f, true);  // 128³
    map.grid->tree().setValue(openvdb::Coord(-100, -100, -100), 1.0f);   // one voxel at a leaf's corner
    map.grid->tree().setValue(openvdb::Coord(-200, -200, -193), 1.0f);
    const MeshMeasures m = measure_mesh(extract(map, 0.5));
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.components, 4u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3, std::pow(8, 3) + std::pow(128, 3), std::pow(129, 3) - std::pow(128, 3));
}

TEST(MarchingCubes, SamplesAtTheIsovalueMakeNoCoincidentVertices) {
    std::vector<float> values = noise(20 * 20 * 20, 3);
    for (float& v : values) v = std::round(v);  // -1, 0, 1: many samples lie on the level
    const TriMesh mesh = extract(map_from_values(Vec3i(20, 20, 20), values));
    EXPECT_TRUE(measure_mesh(mesh).manifold);
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k)
            ASSERT_GT((mesh.points[t[k]] - mesh.points[t[(k + 1) % 3]]).norm(), 1e-4f);
}

TEST(MarchingCubes, NotANumberCountsAsEmpty) {
    std::vector<float> values(10 * 10 * 10, 1.0f);
    values[555] = std::numeric_limits<float>::quiet_NaN();
    values[333] = std::numeric_limits<float>::infinity();
    const TriMesh mesh = extract(map_from_values(Vec3i(10, 10, 10), values), 0.5);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold);
    EXPECT_EQ(m.components, 1u);
}

TEST(MarchingCubes, NoiseWithValuesThatAreNotFiniteIsManifold) {
    const int n = 24;
    std::vector<float> values = noise(n * n * n, 6);
    const float odd[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                         -std::numeric_limits<float>::infinity(), std::numeric_limits<float>::max(),
                         std::numeric_limits<float>::denorm_min()};
    for (std::size_t i = 0; i < values.size(); i += 3) values[i] = odd[i / 3 % 5];
    const TriMesh mesh = extract(map_from_values(Vec3i(n, n, n), values));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.manifold && m.oriented);
    EXPECT_EQ(m.unused_vertices, 0u);
    EXPECT_NO_THROW(check(mesh, "mesh"));  // every coordinate is finite
}

TEST(MarchingCubes, AMapOfOneLayerHasNoCellsAndAnEmptyMesh) {
    for (int axis = 0; axis < 3; ++axis) {
        Vec3i size(12, 12, 12);
        size[axis] = 1;
        const TriMesh mesh = extract(map_from_values(size, noise(144, 7)));
        EXPECT_TRUE(mesh.triangles.empty());
        EXPECT_TRUE(mesh.points.empty());
    }
}

TEST(MarchingCubes, BoxesOfAnySizeMeetTheLeavesAnyhow) {
    for (const Vec3i& size : {Vec3i(2, 8, 9), Vec3i(9, 2, 17), Vec3i(16, 9, 2), Vec3i(17, 8, 10),
                              Vec3i(130, 3, 2), Vec3i(2, 129, 3), Vec3i(3, 2, 128)}) {
        const auto count = static_cast<std::size_t>(size.x() * size.y() * size.z());
        const MeshMeasures m = measure_mesh(extract(map_from_values(size, noise(count, 8))));
        EXPECT_GT(m.faces, 0u);
        EXPECT_TRUE(m.manifold && m.oriented);
        EXPECT_EQ(m.unused_vertices, 0u);
    }
}

TEST(MarchingCubes, WhatLiesOutsideTheBoxDoesNotCount) {
    DensityMap map = map_from_values(Vec3i(21, 18, 13), noise(21 * 18 * 13, 9));
    const TriMesh alone = extract(map);
    auto access = map.grid->getAccessor();
    for (int i = -30; i < 60; ++i) {
        access.setValue(openvdb::Coord(-1, i, i), 5);
        access.setValue(openvdb::Coord(21, i, i), 5);
        access.setValue(openvdb::Coord(i, 18, 5), 5);
        access.setValue(openvdb::Coord(i, i, -1), -5);
        access.setValue(openvdb::Coord(i, 3, 13), 5);
    }
    map.grid->tree().addTile(1, openvdb::Coord(24, 0, 0), 7.0f, true);
    map.grid->tree().addTile(2, openvdb::Coord(-128, 0, 0), 7.0f, true);
    EXPECT_TRUE(same(alone, extract(map)));
    map.grid->tree().addTile(3, openvdb::Coord(-4096, 0, 0), 7.0f, true);
    map.grid->tree().addTile(3, openvdb::Coord(0, 4096, 0), 7.0f, true);
    EXPECT_TRUE(same(alone, extract(map)));
}

TEST(MarchingCubes, RefusesIndicesThatItsNeighboursWouldOverflow) {
    for (const int end : {std::numeric_limits<int>::max() - 5, std::numeric_limits<int>::min() + 5}) {
        DensityMap map;
        map.grid = openvdb::FloatGrid::create(0.0f);
        map.grid->tree().setValue(openvdb::Coord(0, end, 0), 1.0f);
        EXPECT_THROW(extract(map, 0.5), InvalidInput);
        map.frame.size = Vec3i(10, 10, 10);  // in a box it does not count
        EXPECT_TRUE(extract(map, 0.5).empty());
    }
}

TEST(MarchingCubes, NegativeIndicesGiveTheSameSurface) {
    const int n = 20;
    const std::vector<float> values = noise(n * n * n, 10);
    const auto extract_at = [&](const openvdb::Coord& first) {
        DensityMap map;
        map.grid = openvdb::FloatGrid::create(-1.0f);
        map.frame.origin = -Vec3d(first.x(), first.y(), first.z());
        for (int i = 0; i < n * n * n; ++i)
            map.grid->tree().setValue(first.offsetBy(i % n, i / n % n, i / n / n),
                                      values[static_cast<std::size_t>(i)]);
        return measure_mesh(extract(map));
    };
    const MeshMeasures here = extract_at({0, 0, 0});
    EXPECT_TRUE(here.closed && here.manifold);
    for (const openvdb::Coord& first : {openvdb::Coord(-1, -1, -1), openvdb::Coord(-13, -8, -7),
                                        openvdb::Coord(-4100, -130, -5), openvdb::Coord(4090, -20, 123)}) {
        const MeshMeasures there = extract_at(first);
        EXPECT_TRUE(there.closed && there.manifold);
        EXPECT_EQ(there.vertices, here.vertices);
        EXPECT_EQ(there.faces, here.faces);
        EXPECT_EQ(there.euler_characteristic, here.euler_characteristic);
        EXPECT_NEAR(there.area_A2, here.area_A2, 1e-4 * here.area_A2);
    }
}

TEST(MarchingCubes, NormalsPointFromDenseToEmptyInAMirroredFrame) {
    Frame frame = centred_frame(24, 0.1);
    for (int axis = 0; axis < 3; ++axis) {
        frame.axes.col(axis) *= -1;
        frame.origin = frame.axes * Vec3d::Constant(-11.5);
        const MeshMeasures m = measure_mesh(extract(map_from_function(Vec3i(24, 24, 24), frame, sphere)));
        ASSERT_TRUE(m.volume_A3);
        EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.05) << "axes turned round: " << axis + 1;
    }
}

TEST(MarchingCubes, NothingCrossedIsAnEmptyMesh) {
    EXPECT_TRUE(extract(sphere_map(0.2), 5).empty());
    DensityMap none;
    none.grid = openvdb::FloatGrid::create(0.0f);
    EXPECT_TRUE(extract(none, 0.5).empty());
}

TEST(MarchingCubes, ExtremesOfScale) {
    for (const double length : {1e-3, 1.0, 1e8})
        for (const double density : {1e-8, 1e8}) {
            const auto f = [&](const Vec3d& p) { return density * sphere(p / length); };
            const DensityMap map = map_from_function(Vec3i(48, 48, 48), centred_frame(48, 0.05 * length), f);
            const MeshMeasures m = measure_mesh(extract(map));
            EXPECT_TRUE(m.closed && m.manifold);
            EXPECT_NEAR(m.area_A2 / (length * length), 4 * M_PI, 0.02);
        }
}

TEST(MarchingCubes, RefusesAnIsovalueThatIsNotFinite) {
    EXPECT_THROW(extract(sphere_map(0.2), std::nan("")), InvalidInput);
    EXPECT_THROW(extract(sphere_map(0.2), 1e300), InvalidInput);
}

TEST(MarchingCubes, CancelsWhenAsked) {
    EXPECT_THROW(marching_cubes(sphere_map(0.05), {0.0}, Progress([](double) { return false; })), Cancelled);
}
