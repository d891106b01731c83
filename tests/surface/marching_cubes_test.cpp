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
