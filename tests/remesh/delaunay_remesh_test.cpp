// Delaunay remeshing: shape, topology and angles of new meshes of known solids; what is refused.
#include "vdbgeo/remesh/delaunay_remesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/surface/delaunay_surface.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

#define NEEDS_CGAL() \
    if (!have_delaunay()) GTEST_SKIP() << "no CGAL in this build"

DelaunayRemeshOptions bounds(double radius) {
    DelaunayRemeshOptions options;
    options.radius = radius;
    options.distance = 0.3 * radius;
    return options;
}

void expect_sound(const TriMesh& mesh, const MeshMeasures& m) {
    EXPECT_TRUE(m.closed && m.manifold && m.oriented);
    EXPECT_EQ(m.unused_vertices, 0u);
    EXPECT_EQ(self_intersections(mesh).size(), 0u);
}

void expect_refused(const TriMesh& mesh, const std::string& what) {
    try {
        delaunay_remesh(mesh, bounds(0.2));
        FAIL() << what;
    } catch (const InvalidInput& e) {
        EXPECT_NE(std::string(e.what()).find(what), std::string::npos) << e.what();
    }
}

}  // namespace

TEST(DelaunayRemesh, AnIcosphereStaysASphere) {
    NEEDS_CGAL();
    const TriMesh in = moved(icosphere(4, 10), Mat3d::Identity(), Vec3d(300, -200, 100));
    const TriMesh mesh = delaunay_remesh(in, bounds(1.5));
    const MeshMeasures before = measure_mesh(in), m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GE(m.min_angle_deg, 29.99);
    EXPECT_NEAR(*m.volume_A3, *before.volume_A3, 0.02 * *before.volume_A3);
    EXPECT_LT(m.faces, before.faces);
    for (const Vec3f& p : mesh.points)
        EXPECT_NEAR((p.cast<double>() - Vec3d(300, -200, 100)).norm(), 10, 0.05);
}

TEST(DelaunayRemesh, ATorusKeepsItsHandle) {
    NEEDS_CGAL();
    const TriMesh mesh = delaunay_remesh(torus_mesh(10, 3), bounds(1));
    const MeshMeasures m = measure_mesh(mesh);
    expect_sound(mesh, m);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.genus, 1);
    EXPECT_GE(m.min_angle_deg, 29.99);
    EXPECT_NEAR(*m.volume_A3, 2 * M_PI * M_PI * 10 * 9, 75);
}

TEST(DelaunayRemesh, CavitiesAndSmallPartsStay) {
    NEEDS_CGAL();
    const TriMesh hollow = joined(icosphere(3, 10), flipped(icosphere(3, 6)));
    const TriMesh in = joined(hollow, moved(icosphere(1, 0.2), Mat3d::Identity(), Vec3d(14, 1, 2)));
    const TriMesh mesh = delaunay_remesh(in, bounds(2));
    expect_sound(mesh, measure_mesh(mesh));
    const MeshComponents parts = mesh_components(mesh);
    ASSERT_EQ(parts.components.size(), 3u);
    EXPECT_TRUE(parts.components[1].cavity());
    EXPECT_NEAR((parts.components[2].centroid - Vec3d(14, 1, 2)).norm(), 0, 0.05);
}

TEST(DelaunayRemesh, TheSameBytesInEachRun) {
    NEEDS_CGAL();
    const TriMesh a = delaunay_remesh(torus_mesh(10, 3), bounds(2)),
                  b = delaunay_remesh(torus_mesh(10, 3), bounds(2));
    ASSERT_EQ(a.points.size(), b.points.size());
    ASSERT_EQ(a.triangles.size(), b.triangles.size());
    EXPECT_EQ(std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3f)), 0);
    EXPECT_EQ(std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)), 0);
}

TEST(DelaunayRemesh, OpenAndTurnedMeshesAreRefused) {
    NEEDS_CGAL();
    expect_refused(open_cylinder_mesh(1, 2), "boundary edges");
    TriMesh turned = icosphere(2, 1);
    std::swap(turned.triangles[5][0], turned.triangles[5][1]);
    expect_refused(turned, "turned against each other");
    TriMesh twice = icosphere(1, 1);
    twice.triangles.push_back({0, 0, 1});
    expect_refused(twice, "name a vertex twice");
}

TEST(DelaunayRemesh, AnEmptyMeshGivesAnEmptyMesh) {
    NEEDS_CGAL();
    EXPECT_TRUE(delaunay_remesh({}, bounds(1)).empty());
}

TEST(DelaunayRemesh, CapsAndCancelling) {
    NEEDS_CGAL();
    DelaunayRemeshOptions options = bounds(0.2);
    options.max_vertices = 100;
    EXPECT_THROW(delaunay_remesh(icosphere(3, 10), options), NumericalError);
    EXPECT_THROW(delaunay_remesh(icosphere(3, 10), bounds(0.5), Progress([](double f) { return f < 0.3; })),
                 Cancelled);
}

TEST(DelaunayRemesh, OptionsOutOfRangeAreRefused) {
    EXPECT_THROW(DelaunayRemeshOptions().check(), InvalidInput);  // no radius
    EXPECT_NO_THROW(bounds(1).check());
    const auto refused = [](auto change) {
        DelaunayRemeshOptions options = bounds(1);
        change(options);
        EXPECT_THROW(options.check(), InvalidInput);
    };
    refused([](auto& o) { o.angle_deg = 30.5; });
    refused([](auto& o) { o.radius = -1; });
    refused([](auto& o) { o.distance = std::nan(""); });
    refused([](auto& o) { o.max_vertices = 2; });
    refused([](auto& o) { o.max_seconds = -1; });
}
