// Delaunay surfaces: analytic shapes, the bounds they promise, components, caps and determinism.
#include "vdbgeo/surface/delaunay_surface.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>

#include "converters/mrc.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/surface/marching_cubes.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

DensityMap map_of(int n, double h, const std::function<double(const Vec3d&)>& f) {
    return map_from_function(Vec3i(n, n, n), centred_frame(n, h), f);
}

double ball(const Vec3d& p, const Vec3d& centre, double radius) { return radius - (p - centre).norm(); }

TriMesh extract(const DensityMap& map, double isovalue = 0, const Progress& progress = {}) {
    DelaunaySurfaceOptions options;
    options.isovalue = isovalue;
    return delaunay_surface(map, options, progress);
}

bool same(const TriMesh& a, const TriMesh& b) {
    return a.points.size() == b.points.size() && a.triangles.size() == b.triangles.size() &&
           std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3f)) == 0 &&
           std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)) == 0;
}

void expect_sound(const TriMesh& mesh, const MeshMeasures& m) {
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.unused_vertices, 0u);
    EXPECT_EQ(self_intersections(mesh).size(), 0u);
}

#define NEEDS_CGAL() \
    if (!have_delaunay()) GTEST_SKIP() << "no CGAL in this build"

}  // namespace

TEST(DelaunaySurface, ASphereHasItsAreaVolumeAndAngles) {
    NEEDS_CGAL();
    const DensityMap map = map_of(25, 0.1, [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 1); });
    const TriMesh mesh = extract(map);
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GE(m.min_angle_deg, 29.999);
    EXPECT_NEAR(m.area_A2, 4 * M_PI, 0.1);
    EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.05);  // positive: normals point out of the dense side
    for (const Vec3f& p : mesh.points) EXPECT_NEAR(p.cast<double>().norm(), 1, 4e-3);
}

TEST(DelaunaySurface, BoundsAreKept) {
    NEEDS_CGAL();
    const DensityMap map = map_of(25, 0.1, [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 1); });
    std::uint64_t before = 0;
    for (const double radius : {1.6, 0.8, 0.4}) {
        DelaunaySurfaceOptions options;
        options.radius = options.distance = radius;
        options.angle_deg = 25;
        const TriMesh mesh = delaunay_surface(map, options);
        EXPECT_GT(mesh.points.size(), 2 * before);
        before = mesh.points.size();
        EXPECT_GE(measure_mesh(mesh).min_angle_deg, 24.999);
        for (const Triangle& t : mesh.triangles) {
            const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                        c = mesh.points[t[2]].cast<double>();
            const double circumradius =
                (a - b).norm() * (b - c).norm() * (c - a).norm() / (2 * (b - a).cross(c - a).norm());
            EXPECT_LE(circumradius, 0.1 * radius * 1.0001);  // no ball is smaller than the circumcircle
        }
    }
}

TEST(DelaunaySurface, ATorusHasOneHandle) {
    NEEDS_CGAL();
    const TriMesh mesh = extract(map_of(
        32, 0.1, [](const Vec3d& p) { return 0.35 - std::hypot(std::hypot(p.x(), p.y()) - 1, p.z()); }));
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 1);
    EXPECT_GE(m.min_angle_deg, 29.999);
    EXPECT_NEAR(m.area_A2, 4 * M_PI * M_PI * 0.35, 0.2);
    EXPECT_NEAR(*m.volume_A3, 2 * M_PI * M_PI * 0.35 * 0.35, 0.1);
}

TEST(DelaunaySurface, ATinySphereBesideALargeOneIsThere) {
    NEEDS_CGAL();
    const Vec3d tiny(1.3, 1.25, 1.2);
    const TriMesh mesh = extract(map_of(40, 0.1, [&](const Vec3d& p) {
        return std::max(ball(p, Vec3d::Constant(-0.4), 1.2), ball(p, tiny, 0.13));
    }));
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 2u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GE(m.min_angle_deg, 29.9);
    const MeshComponents parts = mesh_components(mesh);
    ASSERT_EQ(parts.components.size(), 2u);
    EXPECT_NEAR((parts.components[1].centroid - tiny).norm(), 0, 0.05);
    EXPECT_GE(parts.components[1].faces, 20u);
}

TEST(DelaunaySurface, NestedCavitiesAreTurnedInward) {
    NEEDS_CGAL();
    const TriMesh mesh = extract(map_of(30, 0.1, [](const Vec3d& p) {
        const double shell = std::min(1.3 - p.norm(), p.norm() - 0.8);
        return std::max(shell, 0.4 - p.norm());
    }));
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 3u);
    EXPECT_GE(m.min_angle_deg, 29.999);
    const auto volume = [](double r) { return 4.0 / 3 * M_PI * r * r * r; };
    EXPECT_NEAR(*m.volume_A3, volume(1.3) - volume(0.8) + volume(0.4), 0.15);
    const MeshComponents parts = mesh_components(mesh);
    EXPECT_FALSE(parts.components[0].cavity());
    EXPECT_TRUE(parts.components[1].cavity());
    EXPECT_FALSE(parts.components[2].cavity());
}

TEST(DelaunaySurface, AtTheBoxTheSurfaceIsItsBorder) {
    NEEDS_CGAL();
    // A ball whose centre is on the face x = 1.2 of the box: half of it is seen.
    const TriMesh mesh =
        extract(map_of(25, 0.1, [](const Vec3d& p) { return ball(p, Vec3d(1.2, 0, 0), 0.9); }));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3, 2.0 / 3 * M_PI * 0.9 * 0.9 * 0.9, 0.05);
    float far = 0;
    for (const Vec3f& p : mesh.points) far = std::max(far, p.x());
    EXPECT_NEAR(far, 1.2, 1e-3);
    EXPECT_LE(far, 1.2001f);
}

TEST(DelaunaySurface, ASolidThatFillsItsBoxIsTheBox) {
    NEEDS_CGAL();
    const TriMesh mesh = extract(map_of(8, 1, [](const Vec3d& p) { return 100 + p.x(); }));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_NEAR(*m.volume_A3, 343, 0.04 * 343);
}

TEST(DelaunaySurface, OneVoxelIsASmallOctahedron) {
    NEEDS_CGAL();
    std::vector<float> values(11 * 11 * 11, 0.f);
    values[5 + 11 * (5 + 11 * 5)] = 1;
    const TriMesh mesh = extract(map_from_values(Vec3i(11, 11, 11), values), 0.5);
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GT(*m.volume_A3, 0.1);
    for (const Vec3f& p : mesh.points) EXPECT_LE((p - Vec3f(5, 5, 5)).norm(), 0.501f);
}

TEST(DelaunaySurface, SampleAtTheIsovalueIsInside) {
    NEEDS_CGAL();
    std::vector<float> values(9 * 9 * 9, 0.f);
    values[4 + 9 * (4 + 9 * 4)] = 1;
    const DensityMap map = map_from_values(Vec3i(9, 9, 9), values);
    const MeshMeasures m = measure_mesh(extract(map, 1));
    EXPECT_TRUE(m.closed && m.manifold);
    EXPECT_EQ(m.components, 1u);
}

TEST(DelaunaySurface, NoiseKeepsEveryComponent) {
    NEEDS_CGAL();
    for (const std::uint64_t seed : {1, 2}) {
        // Blobs of a few voxels, necks and touching corners: the worst there is.
        const DensityMap map = map_from_values(Vec3i(8, 8, 8), noise(8 * 8 * 8, seed));
        MarchingCubesOptions cubes;
        cubes.isovalue = 0.6;
        const MeshMeasures expected = measure_mesh(marching_cubes(map, cubes));
        const TriMesh mesh = extract(map, 0.6);
        const MeshMeasures m = measure_mesh(mesh);
        EXPECT_TRUE(m.closed && m.manifold && m.oriented);
        EXPECT_EQ(m.degenerate_faces, 0u);
        EXPECT_GE(m.components, expected.components / 2);  // open ones may be joined along the border
    }
}

TEST(DelaunaySurface, AnisotropicVoxelsGiveTheSameAngles) {
    NEEDS_CGAL();
    Frame frame;
    frame.axes = Vec3d(0.1, 0.15, 0.25).asDiagonal();
    frame.origin = Vec3d(-1.25, -1.2, -1.25);
    const TriMesh mesh = extract(map_from_function(Vec3i(26, 17, 11), frame,
                                                   [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 1); }));
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 1u);
    EXPECT_GE(m.min_angle_deg, 29.999);
    EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI, 0.15);
}

TEST(DelaunaySurface, TheSameBytesInEachRunAndForAnyThreads) {
    NEEDS_CGAL();
    const DensityMap map = map_from_values(Vec3i(8, 8, 8), noise(8 * 8 * 8, 7));
    const TriMesh first = extract(map, 0.5), second = extract(map, 0.5);
    EXPECT_TRUE(same(first, second));
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_TRUE(same(first, extract(map, 0.5)));
}

TEST(DelaunaySurface, NothingCrossedIsAnEmptyMesh) {
    NEEDS_CGAL();
    const DensityMap map = map_of(12, 0.1, [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 0.4); });
    const TriMesh mesh = extract(map, 10);
    EXPECT_TRUE(mesh.empty());
    EXPECT_TRUE(mesh.points.empty());
}

TEST(DelaunaySurface, TheBoundOnVerticesIsNamed) {
    NEEDS_CGAL();
    const DensityMap map = map_of(25, 0.1, [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 1); });
    DelaunaySurfaceOptions options;
    options.max_vertices = 50;
    try {
        delaunay_surface(map, options);
        FAIL();
    } catch (const NumericalError& e) {
        EXPECT_NE(std::string(e.what()).find("50 vertices"), std::string::npos) << e.what();
    }
}

TEST(DelaunaySurface, TheBoundOnTimeIsNamed) {
    NEEDS_CGAL();
    const DensityMap map = map_of(40, 0.06, [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 1); });
    DelaunaySurfaceOptions options;
    options.max_seconds = 1e-9;
    try {
        delaunay_surface(map, options);
        FAIL();
    } catch (const NumericalError& e) {
        EXPECT_NE(std::string(e.what()).find("did not end within"), std::string::npos) << e.what();
    }
}

TEST(DelaunaySurface, ProgressRunsUpAndCancels) {
    NEEDS_CGAL();
    const DensityMap map = map_of(25, 0.1, [](const Vec3d& p) { return ball(p, Vec3d::Zero(), 1); });
    double last = 0;
    int calls = 0;
    extract(map, 0, Progress([&](double f) {
                EXPECT_GE(f, last);
                last = f;
                ++calls;
                return true;
            }));
    EXPECT_GT(calls, 3);
    EXPECT_THROW(extract(map, 0, Progress([](double f) { return f < 0.3; })), Cancelled);
}

TEST(DelaunaySurface, OptionsOutOfRangeAreRefused) {
    const auto refused = [](auto change, const char* what) {
        DelaunaySurfaceOptions options;
        change(options);
        try {
            options.check();
            FAIL() << what;
        } catch (const InvalidInput& e) {
            EXPECT_NE(std::string(e.what()).find(what), std::string::npos) << e.what();
        }
    };
    const double nan = std::nan("");
    EXPECT_NO_THROW(DelaunaySurfaceOptions().check());
    refused([&](auto& o) { o.isovalue = nan; }, "isovalue");
    refused([&](auto& o) { o.angle_deg = 31; }, "angle");
    refused([&](auto& o) { o.angle_deg = -1; }, "angle");
    refused([&](auto& o) { o.radius = 0; }, "radius");
    refused([&](auto& o) { o.radius = nan; }, "radius");
    refused([&](auto& o) { o.distance = 0; }, "distance");
    refused([&](auto& o) { o.max_vertices = 3; }, "vertices");
    refused([&](auto& o) { o.max_seconds = 0; }, "time");
}

namespace {

DensityMap read_map(const std::string& name) {
    MrcReader reader(data_folder() / name);
    const Vec3i size = reader.frame().size;
    GridBuilder builder(size, reader.order(), {});
    const int columns = size[reader.order()[0]], rows = size[reader.order()[1]],
              count = reader.sections_left();
    std::vector<float> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) *
                              static_cast<std::size_t>(count));
    reader.read_sections(values.data(), count);
    builder.add_sections(values.data(), count);
    return builder.finish(reader.frame());
}

/// Real maps: what comes out is a closed manifold with the components of marching cubes, and nearly all
/// angles are at the bound.
void expect_as_marching_cubes(const DensityMap& map) {
    const double isovalue = map.statistics.mean + 3 * map.statistics.rms;
    MarchingCubesOptions cubes;
    cubes.isovalue = isovalue;
    const MeshMeasures expected = measure_mesh(marching_cubes(map, cubes));
    const MeshMeasures m = measure_mesh(extract(map, isovalue));
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.degenerate_faces, 0u);
    EXPECT_GE(m.components, expected.components);
    EXPECT_LE(m.components, expected.components + 2);  // thinnest necks may part
    EXPECT_LE(m.angles_below_30_fraction, 1e-3);
}

}  // namespace

TEST(DelaunaySurface, RealMapsKeepTheirComponents) {
    NEEDS_CGAL();
    VDBGEO_NEEDS_DATA("daq/2566_3J6B_9.mrc");
    expect_as_marching_cubes(read_map("daq/2566_3J6B_9.mrc"));
}
