// Caps: closed manifolds over the six border planes, for analytic volumes and noise in any frame.
#include "vdbgeo/surface/cap.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/marching_cubes.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

TriMesh capped(const DensityMap& map, double isovalue = 0) {
    return cap_border(marching_cubes(map, {isovalue}), map, isovalue);
}

void expect_closed_manifold(const TriMesh& mesh) {
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_TRUE(m.closed);
    EXPECT_TRUE(m.oriented);
    EXPECT_TRUE(m.manifold) << m.non_manifold_edges << " edges, " << m.non_manifold_vertices << " vertices";
    EXPECT_EQ(m.unused_vertices, 0u);
    EXPECT_NO_THROW(check(mesh, "capped"));
}

/// Skewed, anisotropic, mirrored and far from the origin.
std::vector<Frame> frames(const Vec3i& size) {
    std::vector<Frame> out(3);
    for (Frame& f : out) f.size = size;
    out[1].axes << 1.2, 0.3, -0.1, 0, 0.8, 0.4, 0, 0, 2.5;
    out[1].origin = Vec3d(-350, 812, 40);
    out[2].axes << -1, 0, 0, 0, 1.5, 0, 0.2, 0, 1;
    out[2].origin = Vec3d(3, -7, 1000);
    return out;
}

double gyroid(const Vec3d& p) {
    return std::sin(p.x()) * std::cos(p.y()) + std::sin(p.y()) * std::cos(p.z()) +
           std::sin(p.z()) * std::cos(p.x());
}

}  // namespace

TEST(Cap, AFilledBoxIsItsOwnSize) {
    const Vec3i size(5, 4, 7);
    for (const Frame& frame : frames(size)) {
        const TriMesh mesh = capped(map_from_values(size, std::vector<float>(5 * 4 * 7, 1.0f), frame));
        expect_closed_manifold(mesh);
        const MeshMeasures m = measure_mesh(mesh);
        EXPECT_EQ(m.genus, 0);
        EXPECT_NEAR(*m.volume_A3 / frame.voxel_volume(), 4 * 3 * 6, 1e-3);
        for (const float cap : mesh.find_face_property(cap_property)->values) EXPECT_EQ(cap, 1.0f);
    }
}

TEST(Cap, AnEmptyBoxStaysEmpty) {
    const TriMesh mesh = capped(map_from_values(Vec3i(4, 4, 4), std::vector<float>(64, -1.0f)));
    EXPECT_TRUE(mesh.empty());
    EXPECT_TRUE(mesh.points.empty());
}

TEST(Cap, ASphereCutByAllSixSidesHasItsVolumeAndFlatCaps) {
    // Radius 1 in a box of half edge 0.8: the ball without six caps of height 0.2.
    const int n = 41;
    const DensityMap map = map_from_function(Vec3i(n, n, n), centred_frame(n, 1.6 / (n - 1)),
                                             [](const Vec3d& p) { return 1 - p.norm(); });
    const TriMesh mesh = capped(map);
    expect_closed_manifold(mesh);
    const MeshMeasures m = measure_mesh(mesh);
    EXPECT_EQ(m.genus, 0);
    EXPECT_EQ(m.components, 1u);
    const double cap = M_PI * 0.04 * (3 - 0.2) / 3;
    EXPECT_NEAR(*m.volume_A3, 4.0 / 3 * M_PI - 6 * cap, 0.01);
    const MeshProperty& flags = *mesh.find_face_property(cap_property);
    double cap_area = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        const Triangle& v = mesh.triangles[t];
        const Vec3d normal = (mesh.points[v[1]] - mesh.points[v[0]])
                                 .cross(mesh.points[v[2]] - mesh.points[v[0]])
                                 .cast<double>();
        if (flags.values[t] == 0) continue;
        cap_area += normal.norm() / 2;
        double off = 1;  // all three corners in one plane of the box
        for (int a = 0; a < 3; ++a) {
            double most = 0;
            for (const VertexId p : v) most = std::max(most, std::abs(std::abs(mesh.points[p][a]) - 0.8));
            off = std::min(off, most);
        }
        EXPECT_LT(off, 1e-6);
    }
    EXPECT_NEAR(cap_area, 6 * M_PI * (1 - 0.64), 0.03);
}

TEST(Cap, AGyroidFillsHalfItsBoxInAnyFrame) {
    const Vec3i size(26, 26, 26);  // one period and both its ends
    for (const Frame& frame : frames(size)) {
        std::vector<float> values;
        for (int z = 0; z < 26; ++z)
            for (int y = 0; y < 26; ++y)
                for (int x = 0; x < 26; ++x)
                    values.push_back(static_cast<float>(gyroid(2 * M_PI / 25 * Vec3d(x, y, z))));
        const TriMesh mesh = capped(map_from_values(size, values, frame));
        expect_closed_manifold(mesh);
        EXPECT_NEAR(*measure_mesh(mesh).volume_A3 / frame.voxel_volume() / (25.0 * 25 * 25), 0.5, 0.002);
    }
}

TEST(Cap, NoiseBecomesAClosedManifold) {
    for (const Vec3i& size : {Vec3i(24, 24, 24), Vec3i(2, 30, 30), Vec3i(2, 2, 2), Vec3i(9, 2, 17)})
        for (const Frame& frame : frames(size))
            for (std::uint64_t seed = 1; seed < 5; ++seed) {
                const auto count = static_cast<std::size_t>(size.prod());
                expect_closed_manifold(capped(map_from_values(size, noise(count, seed), frame), 0.1));
            }
}

TEST(Cap, ASurfaceThroughSamplesBecomesAClosedManifold) {
    const Vec3i size(12, 13, 14);
    for (const Frame& frame : frames(size))
        for (std::uint64_t seed = 1; seed < 5; ++seed) {
            std::vector<float> values = noise(static_cast<std::size_t>(size.prod()), seed);
            for (float& v : values) v = std::round(2 * v);  // −2 … 2: a quarter of them at the isovalue
            expect_closed_manifold(capped(map_from_values(size, values, frame), 0));
            expect_closed_manifold(capped(map_from_values(size, values, frame), 1));
        }
}

TEST(Cap, SamplesThatAreNotNumbersAreEmpty) {
    const Vec3i size(10, 10, 10);
    std::vector<float> values = noise(1000, 3);
    for (std::size_t i = 0; i < values.size(); i += 7) values[i] = std::nanf("");
    expect_closed_manifold(capped(map_from_values(size, values)));
}

TEST(Cap, OneLayerHasNoSurface) {
    EXPECT_TRUE(capped(map_from_values(Vec3i(5, 5, 1), std::vector<float>(25, 1.0f))).empty());
}

TEST(Cap, AnUnboundedGridIsClosedAsItIs) {
    DensityMap map = map_from_function(Vec3i(20, 20, 20), centred_frame(20, 0.15),
                                       [](const Vec3d& p) { return std::max(-0.1, 1 - p.norm()); });
    map.frame.size = Vec3i::Zero();
    const TriMesh before = marching_cubes(map, {0.0}), after = cap_border(before, map, 0.0);
    EXPECT_EQ(after.triangles.size(), before.triangles.size());
    for (const float cap : after.find_face_property(cap_property)->values) EXPECT_EQ(cap, 0.0f);
}

TEST(Cap, OtherPropertiesGoOn) {
    const DensityMap map = map_from_values(Vec3i(8, 8, 8), noise(512, 1));
    TriMesh mesh = marching_cubes(map, {0.0});
    const std::size_t points = mesh.points.size();
    mesh.vertex_properties.push_back({"K", 1, std::vector<float>(points, 3.0f)});
    mesh = cap_border(mesh, map, 0.0);
    EXPECT_NO_THROW(check(mesh, "capped"));
    EXPECT_EQ(mesh.vertex_properties[0].values[points - 1], 3.0f);
    EXPECT_EQ(mesh.vertex_properties[0].values[points], 0.0f);
}

TEST(Cap, RefusesASurfaceOfAnotherIsovalueAndASecondCap) {
    const DensityMap map = map_from_values(Vec3i(8, 8, 8), noise(512, 1));
    const TriMesh mesh = marching_cubes(map, {0.0});
    EXPECT_THROW(cap_border(mesh, map, 0.3), InvalidInput);
    EXPECT_THROW(cap_border(mesh, map, std::nan("")), InvalidInput);
    const TriMesh once = cap_border(mesh, map, 0.0);
    EXPECT_THROW(cap_border(once, map, 0.0), InvalidInput);
}
