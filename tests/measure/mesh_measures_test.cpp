// Topology, areas, volumes and angles of meshes of which they are known.
#include "vdbgeo/measure/mesh_measures.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

MeshMeasures triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    return measure_mesh(mesh_of({a, b, c}, {{0, 1, 2}}));
}

/// A mesh in memory that is looked up like one in a file.
class LookedUp : public StoredMesh {
 public:
    explicit LookedUp(const TriMesh& mesh) : mesh_(mesh), caps_(mesh.find_face_property(cap_property)) {}
    std::uint64_t vertices() const override { return mesh_.points.size(); }
    std::uint64_t faces() const override { return mesh_.triangles.size(); }
    void read_faces(std::uint64_t first, std::size_t count, Triangle* triangles, char* caps) const override {
        for (std::size_t f = 0; f < count; ++f) {
            triangles[f] = mesh_.triangles[first + f];
            caps[f] = caps_ && caps_->values[first + f] > 0.5f;
        }
    }
    Vec3f point(VertexId v) const override { return mesh_.points[v]; }
    void release() const override {}

 private:
    const TriMesh& mesh_;
    const MeshProperty* caps_;
};

void expect_same(const MeshMeasures& a, const MeshMeasures& b) {
    EXPECT_EQ(a.vertices, b.vertices);
    EXPECT_EQ(a.faces, b.faces);
    EXPECT_EQ(a.edges, b.edges);
    EXPECT_EQ(a.unused_vertices, b.unused_vertices);
    EXPECT_EQ(a.components, b.components);
    EXPECT_EQ(a.boundary_edges, b.boundary_edges);
    EXPECT_EQ(a.non_manifold_edges, b.non_manifold_edges);
    EXPECT_EQ(a.misoriented_edges, b.misoriented_edges);
    EXPECT_EQ(a.non_manifold_vertices, b.non_manifold_vertices);
    EXPECT_EQ(a.degenerate_faces, b.degenerate_faces);
    EXPECT_EQ(a.duplicate_faces, b.duplicate_faces);
    EXPECT_EQ(a.holes, b.holes);
    EXPECT_EQ(a.euler_characteristic, b.euler_characteristic);
    EXPECT_EQ(a.closed, b.closed);
    EXPECT_EQ(a.oriented, b.oriented);
    EXPECT_EQ(a.manifold, b.manifold);
    EXPECT_EQ(a.area_A2, b.area_A2);
    EXPECT_EQ(a.cap_area_A2, b.cap_area_A2);
    EXPECT_EQ(a.volume_A3, b.volume_A3);
    EXPECT_EQ(a.genus, b.genus);
    EXPECT_EQ(a.min_angle_deg, b.min_angle_deg);
    EXPECT_EQ(a.max_angle_deg, b.max_angle_deg);
    EXPECT_EQ(a.mean_angle_deg, b.mean_angle_deg);
    EXPECT_EQ(a.angle_histogram, b.angle_histogram);
    EXPECT_EQ(a.angles_below_30_fraction, b.angles_below_30_fraction);
    EXPECT_EQ(a.radius_edge_max, b.radius_edge_max);
    EXPECT_EQ(a.radius_edge_mean, b.radius_edge_mean);
    EXPECT_EQ(a.radius_edge_histogram, b.radius_edge_histogram);
}

/// What is held beside the faces of a range.
std::uint64_t held(const TriMesh& mesh) { return 4 * mesh.points.size() + 50000000; }

/// Triangles that do not touch.
TriMesh soup(int count) {
    std::vector<Vec3f> points;
    std::vector<Triangle> triangles;
    for (int i = 0; i < count; ++i) {
        const auto v = static_cast<VertexId>(points.size());
        for (const Vec3f& p : {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)})
            points.push_back(p + Vec3f(0, 0, static_cast<float>(i)));
        triangles.push_back({v, v + 1, v + 2});
    }
    return mesh_of(points, triangles);
}

/// A patch of a lattice of n × n points, and faces at random: open, not manifold, turned, twice there,
/// without area, with corners far apart; some are caps.
TriMesh messy(int n, int more) {
    std::mt19937 random(5);
    const auto below = [&](std::size_t count) { return static_cast<VertexId>(random() % count); };
    std::vector<Vec3f> points;
    std::vector<Triangle> triangles;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
            points.emplace_back(static_cast<float>(x), static_cast<float>(y),
                                static_cast<float>(random() % 97) / 97);
    for (int y = 0; y + 1 < n; ++y)
        for (int x = 0; x + 1 < n; ++x) {
            const auto v = static_cast<VertexId>(y * n + x), up = v + static_cast<VertexId>(n);
            if (random() % 50 != 0) triangles.push_back({v, v + 1, up + 1});
            if (random() % 50 != 0) triangles.push_back({v, up + 1, up});
        }
    for (int i = 0; i < more; ++i) {
        triangles.push_back({below(points.size()), below(points.size()), below(points.size())});
        Triangle again = triangles[below(triangles.size())];
        if (random() % 2 == 0) std::swap(again[0], again[1]);
        triangles.push_back(again);
        again[2] = again[0];
        if (random() % 3 == 0) triangles.push_back(again);
    }
    points.emplace_back(1e6f, 0.0f, 0.0f);  // no face uses it
    TriMesh mesh = mesh_of(points, triangles);
    MeshProperty cap{cap_property, 1, {}};
    for (std::size_t f = 0; f < triangles.size(); ++f) cap.values.push_back(random() % 9 == 0 ? 1.0f : 0.0f);
    mesh.face_properties.push_back(cap);
    return mesh;
}

}  // namespace

TEST(StoredMeshMeasures, AreThoseOfTheMeshInMemory) {
    for (const TriMesh& mesh :
         {tetrahedron(), cube(), joined(cube({0, 0, 0}, 4), flipped(cube({1, 1, 1}, 1))), messy(30, 40),
          messy(150, 0), TriMesh()})
        for (const std::uint64_t faces : {std::uint64_t(60), std::uint64_t(3000), std::uint64_t(1000000)}) {
            SCOPED_TRACE(std::to_string(mesh.triangles.size()) + " faces, " + std::to_string(faces) +
                         " in a range");
            const MeshMeasures m = measure_mesh(mesh);
            const std::uint64_t borders = 4 * 72 * m.boundary_edges;
            expect_same(measure_mesh(LookedUp(mesh), held(mesh) + borders + 120 * faces), m);
        }
    const MeshMeasures m = measure_mesh(messy(30, 40));
    EXPECT_TRUE(m.holes > 1 && m.duplicate_faces > 0 && m.non_manifold_edges > 0 &&
                m.non_manifold_vertices > 0 && m.misoriented_edges > 0 && m.degenerate_faces > 0 &&
                m.components > 0 && m.cap_area_A2 > 0);
}

TEST(StoredMeshMeasures, OfWhatDoesNotFitAreRefused) {
    const TriMesh mesh = messy(30, 0);
    EXPECT_THROW(measure_mesh(LookedUp(mesh), held(mesh) + 80), NumericalError);
    EXPECT_THROW(measure_mesh(LookedUp(mesh), 0), NumericalError);
    const TriMesh apart = soup(100);
    EXPECT_THROW(measure_mesh(LookedUp(apart), held(apart) + 4 * 72 * 299), NumericalError);
    EXPECT_EQ(measure_mesh(LookedUp(apart), held(apart) + 4 * 72 * 300).holes, 100u);
    TriMesh odd = mesh;
    odd.triangles[100][1] = 5000;
    EXPECT_THROW(measure_mesh(LookedUp(odd), held(odd) + 1000000), InvalidInput);
    odd = mesh;
    odd.points[7].x() = std::numeric_limits<float>::infinity();
    EXPECT_THROW(measure_mesh(LookedUp(odd), held(odd) + 1000000), InvalidInput);
}

TEST(MeshMeasures, ATetrahedron) {
    const MeshMeasures m = measure_mesh(tetrahedron());
    EXPECT_EQ(m.vertices, 4u);
    EXPECT_EQ(m.faces, 4u);
    EXPECT_EQ(m.edges, 6u);
    EXPECT_EQ(m.euler_characteristic, 2);
    EXPECT_EQ(m.genus, 0);
    EXPECT_EQ(m.components, 1u);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_NEAR(m.area_A2, 1.5 + std::sqrt(3) / 2, 1e-15);
    EXPECT_NEAR(m.volume_A3.value(), 1.0 / 6, 1e-16);
    EXPECT_NEAR(m.min_angle_deg, 45, 1e-12);
    EXPECT_NEAR(m.max_angle_deg, 90, 1e-12);
    EXPECT_NEAR(m.mean_angle_deg, 60, 1e-12);
}

TEST(MeshMeasures, ACubeFarFromTheOriginHasItsExactVolume) {
    for (const Vec3f& corner : {Vec3f(0, 0, 0), Vec3f(1e5f, -1e5f, 1e5f)})
        for (const float edge : {1.0f, 0.25f}) {
            const MeshMeasures m = measure_mesh(cube(corner, edge));
            EXPECT_EQ(m.edges, 18u);
            EXPECT_EQ(m.genus, 0);
            EXPECT_EQ(m.area_A2, 6 * edge * edge);
            EXPECT_NEAR(m.volume_A3.value(), edge * edge * edge, 1e-14);
        }
}

TEST(MeshMeasures, InwardNormalsMakeANegativeVolume) {
    EXPECT_NEAR(measure_mesh(flipped(cube())).volume_A3.value(), -1, 1e-15);
    // A hollow in a solid counts against it.
    const MeshMeasures m = measure_mesh(joined(cube({0, 0, 0}, 4), flipped(cube({1, 1, 1}, 1))));
    EXPECT_NEAR(m.volume_A3.value(), 63, 1e-12);
    EXPECT_EQ(m.components, 2u);
    EXPECT_EQ(m.genus, 0);
}

TEST(MeshMeasures, AnUnusedPointFarAwayDisturbsNothing) {
    TriMesh mesh = cube();
    mesh.points.push_back(Vec3f(1e30f, 0, 0));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.vertices, 9u);
    EXPECT_EQ(m.unused_vertices, 1u);
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.euler_characteristic, 2);
    EXPECT_NEAR(m.volume_A3.value(), 1, 1e-15);
}

TEST(MeshMeasures, HandlesAreCounted) {
    const MeshMeasures one = measure_mesh(torus_mesh(3, 1));
    EXPECT_EQ(one.genus, 1);
    EXPECT_EQ(one.euler_characteristic, 0);
    EXPECT_GT(one.volume_A3.value(), 0);
    EXPECT_NEAR(one.area_A2, 4 * M_PI * M_PI * 3, 0.2);
    EXPECT_NEAR(*one.volume_A3, 2 * M_PI * M_PI * 3, 0.3);
    const TriMesh apart = moved(torus_mesh(3, 1), Mat3d::Identity(), Vec3d(20, 0, 0));
    const MeshMeasures three = measure_mesh(joined(joined(torus_mesh(3, 1), apart), icosphere(2, 1)));
    EXPECT_EQ(three.components, 3u);
    EXPECT_EQ(three.genus, 2);
    EXPECT_EQ(three.euler_characteristic, 2);
}

TEST(MeshMeasures, TwoCubesThatTouchWithoutSharingAnythingAreTwo) {
    const MeshMeasures m = measure_mesh(joined(cube(), cube({1, 0, 0})));
    EXPECT_EQ(m.components, 2u);
    EXPECT_TRUE(m.closed && m.manifold);
    EXPECT_NEAR(m.volume_A3.value(), 2, 1e-14);
}

TEST(MeshMeasures, TwoCubesThatShareAVertex) {
    const MeshMeasures m = measure_mesh(glued(cube(), cube({1, 1, 1}), {{7, 0}}));
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.non_manifold_vertices, 1u);
    EXPECT_EQ(m.non_manifold_edges, 0u);
    EXPECT_EQ(m.unused_vertices, 1u);
    EXPECT_EQ(m.euler_characteristic, 3);
    EXPECT_TRUE(m.closed && m.oriented);
    EXPECT_FALSE(m.manifold);
    EXPECT_FALSE(m.genus);
    EXPECT_NEAR(m.volume_A3.value(), 2, 1e-14);  // still encloses one
}

TEST(MeshMeasures, TwoCubesThatShareAnEdge) {
    const MeshMeasures m = measure_mesh(glued(cube(), cube({1, 1, 0}), {{3, 0}, {7, 4}}));
    EXPECT_EQ(m.components, 1u);
    EXPECT_EQ(m.non_manifold_edges, 1u);
    EXPECT_EQ(m.boundary_edges, 0u);
    EXPECT_EQ(m.non_manifold_vertices, 0u);
    EXPECT_EQ(m.edges, 35u);
    EXPECT_FALSE(m.closed || m.manifold);
    EXPECT_FALSE(m.volume_A3 || m.genus);
}

TEST(MeshMeasures, AMoebiusStripCannotBeOriented) {
    const MeshMeasures m = measure_mesh(moebius(30));
    EXPECT_TRUE(m.manifold);
    EXPECT_FALSE(m.oriented);
    EXPECT_EQ(m.misoriented_edges, 1u);
    EXPECT_EQ(m.euler_characteristic, 0);
    EXPECT_EQ(m.boundary_edges, 60u);
    EXPECT_FALSE(m.volume_A3 || m.genus);
}

TEST(MeshMeasures, AnOpenCylinder) {
    const MeshMeasures m = measure_mesh(open_cylinder_mesh(1, 2, 24, 96));
    EXPECT_EQ(m.boundary_edges, 2u * 96u);
    EXPECT_EQ(m.euler_characteristic, 0);
    EXPECT_TRUE(m.manifold && m.oriented);
    EXPECT_FALSE(m.closed);
    EXPECT_FALSE(m.volume_A3 || m.genus);
    EXPECT_NEAR(m.area_A2, 2 * 96 * std::sin(M_PI / 96) * 2, 1e-5);
}

TEST(MeshMeasures, AFaceTurnedOver) {
    TriMesh mesh = cube();
    std::swap(mesh.triangles[5][0], mesh.triangles[5][1]);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.misoriented_edges, 3u);
    EXPECT_TRUE(m.closed && m.manifold);
    EXPECT_FALSE(m.oriented);
    EXPECT_FALSE(m.volume_A3 || m.genus);
    EXPECT_EQ(m.area_A2, 6);
}

TEST(MeshMeasures, FacesThatNameAVertexTwiceAreLeftOutOfTheTopology) {
    TriMesh mesh = cube();
    mesh.triangles.push_back({0, 2, 0});
    mesh.triangles.push_back({1, 1, 1});
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.faces, 14u);
    EXPECT_EQ(m.degenerate_faces, 2u);
    EXPECT_EQ(m.edges, 18u);
    EXPECT_EQ(m.euler_characteristic, 2);
    EXPECT_TRUE(m.closed && m.oriented);
    EXPECT_FALSE(m.manifold);
    EXPECT_NEAR(m.volume_A3.value(), 1, 1e-15);
    EXPECT_EQ(m.angle_histogram[179], 2u);
    const MeshMeasures only = measure_mesh(mesh_of({{0, 0, 0}, {1, 0, 0}}, {{0, 1, 0}}));
    EXPECT_FALSE(only.closed || only.manifold);
    EXPECT_EQ(only.components, 0u);
    EXPECT_EQ(only.unused_vertices, 2u);
}

TEST(MeshMeasures, ThreeFacesOnOneEdge) {
    const MeshMeasures m = measure_mesh(mesh_of({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}},
                                                {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}}));
    EXPECT_EQ(m.non_manifold_edges, 1u);
    EXPECT_EQ(m.boundary_edges, 6u);
    EXPECT_EQ(m.edges, 7u);
    EXPECT_EQ(m.components, 1u);
}

TEST(MeshMeasures, AnglesOfKnownTriangles) {
    const MeshMeasures right = triangle({0, 0, 0}, {4, 0, 0}, {0, 3, 0});
    EXPECT_NEAR(right.min_angle_deg, std::atan2(3, 4) * 180 / M_PI, 1e-13);
    EXPECT_NEAR(right.max_angle_deg, 90, 1e-13);
    const MeshMeasures obtuse = triangle({0, 0, 0}, {1, 0, 0}, {-1, 1, 0});
    EXPECT_NEAR(obtuse.max_angle_deg, 135, 1e-13);
    EXPECT_EQ(obtuse.angle_histogram[135] + obtuse.angle_histogram[134], 1u);
}

TEST(MeshMeasures, NeedlesHaveExactAngles) {
    // 1e-6 high over a base of 1, also beside other points far away.
    const float high = 1e-6f;
    const double sharp = std::atan2(double(high), 0.5) * 180 / M_PI;
    TriMesh mesh = mesh_of({{0, 0, 0}, {1, 0, 0}, {0.5f, high, 0}}, {{0, 1, 2}});
    for (const float far : {0.0f, 12345.678f}) {
        if (far > 0) mesh = joined(mesh, cube({far, far / 3, -far}, 1));
        const MeshMeasures m = measure_mesh(mesh);
        EXPECT_NEAR(m.min_angle_deg / sharp, 1, 1e-12);
        EXPECT_NEAR((180 - m.max_angle_deg) / (2 * sharp), 1, 1e-7);  // 180 − 1e-4 has 10 digits behind it
    }
}

TEST(MeshMeasures, AFaceWithoutAreaCountsAsFlat) {
    const MeshMeasures m = triangle({0.1f, 0.2f, 0.3f}, {0.2f, 0.4f, 0.6f}, {0.4f, 0.8f, 1.2f});
    EXPECT_EQ(m.min_angle_deg, 0);
    EXPECT_EQ(m.max_angle_deg, 180);
    EXPECT_EQ(m.mean_angle_deg, 60);
    EXPECT_EQ(m.angle_histogram[0], 2u);
    EXPECT_EQ(m.angle_histogram[179], 1u);
    EXPECT_EQ(m.degenerate_faces, 0u);
}

TEST(MeshMeasures, TheHistogramHoldsEveryAngle) {
    for (const TriMesh& mesh : {icosphere(3, 2), torus_mesh(3, 1), open_cylinder_mesh(1, 2), tetrahedron()}) {
        const MeshMeasures m = measure_mesh(mesh);
        EXPECT_EQ(std::accumulate(m.angle_histogram.begin(), m.angle_histogram.end(), std::uint64_t(0)),
                  3 * m.faces);
        EXPECT_NEAR(m.mean_angle_deg, 60, 1e-9);
        EXPECT_GT(m.angle_histogram[std::size_t(m.min_angle_deg)], 0u);
        EXPECT_GT(m.angle_histogram[std::size_t(m.max_angle_deg)], 0u);
    }
}

TEST(MeshMeasures, AnEmptyMesh) {
    for (TriMesh mesh : {TriMesh(), mesh_of({{1, 2, 3}}, {})}) {
        const MeshMeasures m = measure_mesh(mesh);
        EXPECT_EQ(m.vertices, mesh.points.size());
        EXPECT_EQ(m.unused_vertices, mesh.points.size());
        EXPECT_EQ(m.faces + m.edges + m.components, 0u);
        EXPECT_FALSE(m.closed);
        EXPECT_FALSE(m.volume_A3 || m.genus);
        EXPECT_EQ(m.area_A2, 0);
    }
}

TEST(MeshMeasures, SameBitsForAnyNumberOfThreads) {
    const TriMesh mesh = icosphere(6, 10);
    const MeshMeasures once = measure_mesh(mesh);
    for (const std::size_t threads : {1, 2, 7}) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const MeshMeasures m = measure_mesh(mesh);
        EXPECT_EQ(m.area_A2, once.area_A2);
        EXPECT_EQ(m.volume_A3, once.volume_A3);
        EXPECT_EQ(m.mean_angle_deg, once.mean_angle_deg);
    }
}

TEST(MeshMeasures, BadMeshesAreRefused) {
    EXPECT_THROW(measure_mesh(mesh_of({{0, 0, 0}}, {{0, 1, 2}})), InvalidInput);
    const float nothing = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(measure_mesh(mesh_of({{0, 0, nothing}}, {})), InvalidInput);
    EXPECT_THROW(measure_mesh(tetrahedron(), Progress([](double) { return false; })), Cancelled);
}

TEST(MeshMeasures, CapsAreNoPartOfTheAreaButBoundTheVolume) {
    TriMesh mesh = cube();
    mesh.face_properties.push_back({cap_property, 1, std::vector<float>(12, 0)});
    mesh.face_properties[0].values[0] = mesh.face_properties[0].values[1] = 1;
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.area_A2, 5);
    EXPECT_EQ(m.cap_area_A2, 1);
    EXPECT_NEAR(m.volume_A3.value(), 1, 1e-15);
}

TEST(MeshMeasures, RadiusEdgeRatiosOfKnownTriangles) {
    const MeshMeasures even = triangle({1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    EXPECT_NEAR(even.radius_edge_max, 1 / std::sqrt(3), 1e-15);
    EXPECT_EQ(even.radius_edge_histogram[1], 1u);
    EXPECT_EQ(even.angles_below_30_fraction, 0);
    const MeshMeasures right = triangle({0, 0, 0}, {4, 0, 0}, {0, 3, 0});  // R = 5/2
    EXPECT_NEAR(right.radius_edge_mean, 2.5 / 3, 1e-15);
    const MeshMeasures needle = triangle({0, 0, 0}, {1, 0, 0}, {0.5f, 0.01f, 0});
    EXPECT_EQ(needle.radius_edge_histogram[39], 1u);
    EXPECT_NEAR(needle.angles_below_30_fraction, 2.0 / 3, 1e-15);
    EXPECT_NEAR(needle.radius_edge_max, 0.5 / std::sin(needle.min_angle_deg * M_PI / 180), 1e-9);
}

TEST(MeshMeasures, AFaceWithoutAreaHasNoRadius) {
    const MeshMeasures m = triangle({0, 0, 0}, {1, 0, 0}, {2, 0, 0});
    EXPECT_EQ(m.radius_edge_max, 0);
    EXPECT_EQ(m.radius_edge_mean, 0);
    EXPECT_EQ(m.radius_edge_histogram[39], 1u);
}

TEST(MeshMeasures, DuplicateFacesAreCountedEitherWayUp) {
    TriMesh mesh = cube();
    EXPECT_EQ(measure_mesh(mesh).duplicate_faces, 0u);
    mesh.triangles.push_back({3, 0, 2});
    mesh.triangles.push_back({3, 2, 0});
    mesh.triangles.push_back({7, 1, 5});
    EXPECT_EQ(measure_mesh(mesh).duplicate_faces, 3u);
    EXPECT_EQ(
        measure_mesh(mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {2, 1, 0}})).duplicate_faces, 1u);
}

TEST(MeshMeasures, HolesAreLoopsOfBoundaryEdges) {
    EXPECT_EQ(measure_mesh(cube()).holes, 0u);
    EXPECT_EQ(measure_mesh(open_cylinder_mesh(1, 2)).holes, 2u);
    EXPECT_EQ(measure_mesh(moebius(30)).holes, 1u);
    // Holes that touch in a vertex are one: the faces between them hold together there by nothing but the
    // vertex.
    TriMesh mesh = icosphere(2, 1);
    const VertexId v = mesh.triangles[0][0];
    std::vector<std::size_t> at;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        if (std::count(mesh.triangles[f].begin(), mesh.triangles[f].end(), v)) at.push_back(f);
    std::size_t apart = at.size();
    for (const std::size_t f : at) {
        const auto shared =
            std::count_if(mesh.triangles[f].begin(), mesh.triangles[f].end(), [&](VertexId w) {
                const Triangle& t = mesh.triangles[at[0]];
                return std::count(t.begin(), t.end(), w);
            });
        if (shared == 1) apart = f;
    }
    mesh.triangles.erase(mesh.triangles.begin() + std::ptrdiff_t(apart));
    mesh.triangles.erase(mesh.triangles.begin() + std::ptrdiff_t(at[0]));
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.holes, 1u);
    EXPECT_EQ(m.boundary_edges, 6u);
    EXPECT_EQ(m.non_manifold_vertices, 1u);
}
