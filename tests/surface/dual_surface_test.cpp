// The dual surface: closed, oriented, of the right topology and size; borders, masks, adaptivity.
#include "vdbgeo/surface/dual_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/support/sound_mesh.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

double sphere(const Vec3d& p) { return 1 - p.norm(); }

DensityMap sphere_map(int n = 40) {
    return map_from_function(Vec3i(n, n, n), centred_frame(n, 2.6 / n), sphere);
}

DualSurfaceOptions at(double isovalue, double adaptivity = 0) {
    DualSurfaceOptions options;
    options.isovalue = isovalue;
    options.adaptivity = adaptivity;
    return options;
}

bool same(const TriMesh& a, const TriMesh& b) {
    return a.points.size() == b.points.size() && a.triangles.size() == b.triangles.size() &&
           std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3f)) == 0 &&
           std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)) == 0;
}

}  // namespace

TEST(DualSurface, ASphereIsClosedAndFacesOutward) {
    const MeshMeasures m = expect_closed_manifold(dual_surface(sphere_map(), at(0)));
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.03);
    EXPECT_GT(m.min_angle_deg, 15);
}

TEST(DualSurface, AMirroredSkewedFrameFacesOutwardToo) {
    Frame frame = centred_frame(40, 1);
    frame.axes << -0.07, 0.01, 0, 0, 0.06, 0.02, 0, 0, 0.08;
    frame.origin = -frame.axes * Vec3d::Constant(19.5);
    const DensityMap map = map_from_function(Vec3i(40, 40, 40), frame, sphere);
    const MeshMeasures m = expect_closed_manifold(dual_surface(map, at(0)));
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.05);
}

TEST(DualSurface, TheClassOfTheGridPlaysNoPart) {
    const DensityMap map = sphere_map();
    const TriMesh plain = dual_surface(map, at(0));
    map.grid->setGridClass(openvdb::GRID_LEVEL_SET);
    EXPECT_TRUE(same(plain, dual_surface(map, at(0))));
    map.grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    EXPECT_TRUE(same(plain, dual_surface(map, at(0))));
}

TEST(DualSurface, TwoBallsAreTwoComponents) {
    const auto balls = [](const Vec3d& p) {
        return 0.4 - std::min((p - Vec3d(0.6, 0, 0)).norm(), (p + Vec3d(0.6, 0, 0)).norm());
    };
    const DensityMap map = map_from_function(Vec3i(50, 50, 50), centred_frame(50, 0.05), balls);
    const MeshMeasures m = expect_closed_manifold(dual_surface(map, at(0)));
    EXPECT_EQ(m.components, 2u);
    EXPECT_NEAR(*m.volume_A3, 2 * 4.0 / 3 * M_PI * 0.064, 0.01);
}

TEST(DualSurface, AdaptivityTakesFacesAwayAndStaysClosed) {
    const DensityMap map = sphere_map(60);
    const std::uint64_t all = expect_closed_manifold(dual_surface(map, at(0))).faces;
    for (const double adaptivity : {0.1, 0.5, 1.0}) {
        const MeshMeasures m = expect_closed_manifold(dual_surface(map, at(0, adaptivity)));
        EXPECT_LT(m.faces, all / 2) << adaptivity;
        EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.3);
    }
}

TEST(DualSurface, NoiseBecomesAClosedManifold) {
    const Vec3i size(20, 24, 18);
    for (const double adaptivity : {0.0, 0.3})
        for (std::uint64_t seed = 1; seed < 4; ++seed) {
            const auto values = noise(static_cast<std::size_t>(size.prod()), seed);
            expect_closed_manifold(dual_surface(map_from_values(size, values), at(0.2, adaptivity)));
        }
}

TEST(DualSurface, SurfacesThroughSamplesBecomeClosedManifolds) {
    const Vec3i size(20, 24, 18);
    std::vector<float> values = noise(static_cast<std::size_t>(size.prod()), 5);
    for (float& v : values) v = std::round(2 * v);
    for (const double isovalue : {-1.0, 0.0, 1.0})
        expect_closed_manifold(dual_surface(map_from_values(size, values), at(isovalue)));
}

TEST(DualSurface, ADenseBoxClosesAroundItsBorder) {
    const Vec3i size(10, 8, 12);
    std::vector<float> values(static_cast<std::size_t>(size.prod()), 1.0f);
    const MeshMeasures m = expect_closed_manifold(dual_surface(map_from_values(size, values), at(0)));
    EXPECT_EQ(m.components, 1u);
    EXPECT_GT(*m.volume_A3, 9 * 7 * 11);
    EXPECT_LT(*m.volume_A3, 11 * 9 * 13);
    values[5 + 10 * (4 + 8 * 6)] = -1;  // a hole inside
    EXPECT_EQ(expect_closed_manifold(dual_surface(map_from_values(size, values), at(0))).components, 2u);
}

TEST(DualSurface, ADenseBackgroundEndsAtTheBox) {
    SparsifyOptions sparse;
    const Vec3i size(30, 30, 30);
    DensityMap map = map_from_function(size, centred_frame(30, 0.1), sphere, sparse);
    // Dense everywhere but in the ball: −density at −0.
    for (auto it = map.grid->beginValueAll(); it; ++it) it.setValue(-*it);
    map.grid->tree().root().setBackground(1.0f, /*updateChildNodes=*/false);
    const MeshMeasures m = expect_closed_manifold(dual_surface(map, at(0)));
    EXPECT_EQ(m.components, 2u);  // the ball and the box around
    EXPECT_NEAR(*m.volume_A3, 27 - 4.0 / 3 * M_PI, 1.5);
}

TEST(DualSurface, SamplesThatAreNotNumbersAreEmpty) {
    const Vec3i size(12, 12, 12);
    std::vector<float> values(static_cast<std::size_t>(size.prod()), 1.0f);
    values[6 + 12 * (6 + 12 * 6)] = std::nanf("");
    values[3 + 12 * (3 + 12 * 3)] = std::numeric_limits<float>::infinity();
    EXPECT_EQ(expect_closed_manifold(dual_surface(map_from_values(size, values), at(0))).components, 2u);
}

TEST(DualSurface, AMaskKeepsItsPart) {
    const int n = 40;
    const DensityMap map = sphere_map(n);
    DualSurfaceOptions options = at(0);
    const auto mask = openvdb::BoolGrid::create(false);
    mask->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(n / 2, n, n)), true);
    mask->setTransform(openvdb::math::Transform::createLinearTransform(7.0));  // plays no part
    options.mask = mask;
    const TriMesh part = dual_surface(map, options);
    const MeshMeasures m = measure_mesh(part), whole = measure_mesh(dual_surface(map, at(0)));
    EXPECT_TRUE(m.manifold && m.oriented);
    EXPECT_GT(m.boundary_edges, 0u);
    EXPECT_NEAR(m.area_A2 / whole.area_A2, 0.5, 0.05);
    for (const Vec3f& p : part.points) EXPECT_LT(p.x(), 0.15f);
}

TEST(DualSurface, OneAndTwoThreadsGiveTheSameBytes) {
    const DensityMap map = map_from_values(Vec3i(40, 40, 40), noise(64000, 9));
    for (const double adaptivity : {0.0, 0.4}) {
        TriMesh one, two;
        with_threads(1, [&] { one = dual_surface(map, at(0, adaptivity)); });
        with_threads(2, [&] { two = dual_surface(map, at(0, adaptivity)); });
        EXPECT_TRUE(same(one, two));
    }
}

TEST(DualSurface, NothingCrossedIsEmptyAndBadOptionsAreRefused) {
    EXPECT_TRUE(dual_surface(sphere_map(), at(5)).empty());
    EXPECT_THROW(dual_surface(sphere_map(), at(std::nan(""))), InvalidInput);
    EXPECT_THROW(dual_surface(sphere_map(), at(0, 1.5)), InvalidInput);
}
