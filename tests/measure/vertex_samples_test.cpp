#include "vdbgeo/measure/vertex_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "converters/map_file.h"
#include "tests/support/data.h"
#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/surface/marching_cubes.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::map_from_function;

double linear(const Vec3d& p) { return 2 + 0.5 * p.x() - 0.25 * p.y() + 0.125 * p.z(); }

VertexSampleOptions along(double offset, double mean_over = 0) {
    VertexSampleOptions options;
    options.offset = offset;
    options.mean_over = mean_over;
    return options;
}

TEST(VertexSamples, LinearFieldsAreExactInAnyFrame) {
    Frame sheared;
    sheared.axes << 1.0, 0.35, -0.3, 0.05, 1.2, 0.4, 0, -0.1, 0.9;
    sheared.origin = -sheared.axes * Vec3d(25.4, 25.1, 25.7);
    for (const Frame& frame : {centred_frame(50, 0.7), sheared}) {
        const DensityMap map = map_from_function({50, 50, 50}, frame, linear);
        const TriMesh mesh = test::icosphere(3, 8);
        for (const VertexSampleOptions& options :
             {along(0), along(1.5), along(-3), along(0, 4), along(0.5, 1)}) {
            const MeshProperty found = sample_at_vertices(mesh, map, "other", options);
            EXPECT_EQ(found.name, "other");
            EXPECT_EQ(found.components, 1);
            ASSERT_EQ(found.values.size(), mesh.points.size());
            for (std::size_t v = 0; v < found.values.size(); ++v) {
                const Vec3d p = mesh.points[v].cast<double>();
                // Linear: the mean is the value in the middle. Vertex normals of this sphere are radial to 1
                // %.
                EXPECT_NEAR(found.values[v], linear(p + options.offset * p.normalized()),
                            1e-5 + 0.01 * std::abs(options.offset));
            }
        }
    }
}

TEST(VertexSamples, OffsetAndMeanGoAlongTheOutwardNormal) {
    const DensityMap map = map_from_function({40, 40, 40}, centred_frame(40, 1), linear);
    TriMesh mesh = test::ring_mesh(9, 9, false, [](int r, int c) {  // z = 0, its normal along +z or −z
        return Vec3d(r - 4.0, c - 4.0, 0);
    });
    const Vec3d a = mesh.points[mesh.triangles[0][0]].cast<double>();
    const double up = (mesh.points[mesh.triangles[0][1]].cast<double>() - a)
                          .cross(mesh.points[mesh.triangles[0][2]].cast<double>() - a)
                          .z();
    const MeshProperty out = sample_at_vertices(mesh, map, "a", along(3));
    const Vec3d p = mesh.points[40].cast<double>();
    EXPECT_NEAR(out.values[40], linear(p + Vec3d(0, 0, up > 0 ? 3 : -3)), 1e-6);
    for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
    const MeshProperty in = sample_at_vertices(mesh, map, "a", along(3));
    EXPECT_NEAR(in.values[40], linear(p - Vec3d(0, 0, up > 0 ? 3 : -3)), 1e-6);

    // ∫ z² dz / L over [−L/2, L/2] is L²/12; trapezoids between samples at whole voxels add 1/6 at most.
    const DensityMap square =
        map_from_function({41, 41, 41}, centred_frame(41, 1), [](const Vec3d& q) { return q.z() * q.z(); });
    EXPECT_NEAR(sample_at_vertices(mesh, square, "a", along(0, 6)).values[40], 3 + 1 / 6.0, 0.05);
}

TEST(VertexSamples, NothingOutsideTheBox) {
    const DensityMap map = map_from_function({9, 9, 9}, {}, linear);
    const TriMesh mesh = test::mesh_of({{0, 0, 0}, {8, 8, 8}, {8.01f, 4, 4}, {4, -0.0005f, 4}, {4, 4, -1}},
                                       {{0, 1, 2}, {0, 3, 4}});
    const MeshProperty found = sample_at_vertices(mesh, map, "a");
    EXPECT_EQ(found.values[0], 2);
    EXPECT_EQ(found.values[1], 5);
    EXPECT_TRUE(std::isnan(found.values[2]));
    EXPECT_EQ(found.values[3], 4.5f);  // rounding is forgiven
    EXPECT_TRUE(std::isnan(found.values[4]));
    // The mean needs all its places.
    const TriMesh ball = [] {
        TriMesh m = test::icosphere(2, 3.5);
        for (Vec3f& p : m.points) p += Vec3f(4, 4, 4);
        return m;
    }();
    for (const float v : sample_at_vertices(ball, map, "a").values) EXPECT_FALSE(std::isnan(v));
    const MeshProperty mean = sample_at_vertices(ball, map, "a", along(0, 4));
    for (std::size_t v = 0; v < mean.values.size(); ++v) {
        const Vec3d p = ball.points[v].cast<double>() - Vec3d(4, 4, 4);
        const double reach = (p + 2 * p.normalized()).cwiseAbs().maxCoeff();
        if (std::abs(reach - 4) < 0.05) continue;
        EXPECT_EQ(std::isnan(mean.values[v]), reach > 4);
    }
}

TEST(VertexSamples, BackgroundAndNaN) {
    DensityMap map = map_from_function({9, 9, 9}, {}, linear);
    map.grid = openvdb::FloatGrid::create(-3);
    map.grid->tree().setValueOn(openvdb::Coord(4, 4, 4), 1);
    map.grid->tree().setValueOn(openvdb::Coord(1, 1, 1), std::numeric_limits<float>::quiet_NaN());
    const TriMesh mesh = test::mesh_of({{7, 7, 7}, {4.5f, 4, 4}, {1.5f, 1, 1}, {2, 1, 1}, {20, 20, 20}},
                                       {{0, 1, 2}, {2, 3, 4}});
    const MeshProperty found = sample_at_vertices(mesh, map, "a");
    EXPECT_EQ(found.values[0], -3);
    EXPECT_EQ(found.values[1], -1);
    EXPECT_TRUE(std::isnan(found.values[2]));
    EXPECT_EQ(found.values[3], -3);  // the bad sample has no weight
    EXPECT_TRUE(std::isnan(found.values[4]));
    map.frame.size.setZero();  // a grid without a box goes on as background
    EXPECT_EQ(sample_at_vertices(mesh, map, "a").values[4], -3);
}

TEST(VertexSamples, CapsDoNotTurnNormals) {
    // A prism's edge between a side (x = 0, outward −x) and a lid (z = 0, outward −z).
    TriMesh mesh = test::mesh_of({{0, 0, 0}, {0, 2, 0}, {0, 1, 2}, {2, 1, 0}}, {{0, 2, 1}, {0, 1, 3}});
    const DensityMap map = map_from_function({21, 21, 21}, centred_frame(21, 1), linear);
    mesh.face_properties.push_back({cap_property, 1, {0, 1}});
    const MeshProperty found = sample_at_vertices(mesh, map, "a", along(1));
    const Vec3d side =
        (mesh.points[2] - mesh.points[0]).cross(mesh.points[1] - mesh.points[0]).cast<double>().normalized();
    EXPECT_NEAR(found.values[0], linear(side), 1e-6);
    const Vec3d lid =
        (mesh.points[1] - mesh.points[0]).cross(mesh.points[3] - mesh.points[0]).cast<double>().normalized();
    EXPECT_NEAR(found.values[3], linear(mesh.points[3].cast<double>() + lid), 1e-6);  // caps only

    TriMesh lone = mesh;
    lone.points.emplace_back(1, 1, 1);
    EXPECT_EQ(sample_at_vertices(lone, map, "a").values[4], static_cast<float>(linear(Vec3d(1, 1, 1))));
    EXPECT_TRUE(std::isnan(sample_at_vertices(lone, map, "a", along(1)).values[4]));
}

TEST(VertexSamples, SameBytesForAnyNumberOfThreads) {
    const DensityMap map = map_from_function({30, 30, 30}, centred_frame(30, 1), [](const Vec3d& p) {
        return std::sin(p.x()) * std::cos(2 * p.y()) + p.z();
    });
    const TriMesh mesh = test::icosphere(5, 11);
    MeshProperty one, two;
    test::with_threads(1, [&] { one = sample_at_vertices(mesh, map, "a", along(0.3, 5)); });
    test::with_threads(2, [&] { two = sample_at_vertices(mesh, map, "a", along(0.3, 5)); });
    EXPECT_EQ(std::memcmp(one.values.data(), two.values.data(), 4 * one.values.size()), 0);
}

TEST(VertexSamples, RefusesWhatMakesNoSense) {
    const DensityMap map = map_from_function({8, 8, 8}, {}, linear);
    const TriMesh mesh = test::tetrahedron();
    EXPECT_THROW(sample_at_vertices(mesh, map, ""), InvalidInput);
    EXPECT_THROW(sample_at_vertices(mesh, map, "a", along(std::nan(""))), InvalidInput);
    EXPECT_THROW(sample_at_vertices(mesh, map, "a", along(0, -1)), InvalidInput);
    EXPECT_THROW(sample_at_vertices(mesh, map, "a", along(0, 501)), InvalidInput);
    EXPECT_TRUE(sample_at_vertices({}, map, "a").values.empty());
}

/// The two maps belong together, and the second's header was never set.
TEST(VertexSamples, LocalResolutionOnARealSurface) {
    VDBGEO_NEEDS_DATA("ngl/betaGal.mrc");
    VDBGEO_NEEDS_DATA("ngl/localResolution.mrc");
    MapFile density = read_map(test::data_folder() / "ngl/betaGal.mrc");
    MapFile resolution = read_map(test::data_folder() / "ngl/localResolution.mrc");
    resolution.map.frame = density.map.frame;
    MarchingCubesOptions options;
    options.isovalue = density.map.statistics.mean + 3 * density.map.statistics.rms;
    const TriMesh mesh = marching_cubes(density.map, options);
    ASSERT_GT(mesh.points.size(), 1000u);
    const MeshProperty found = sample_at_vertices(mesh, resolution.map, "resolution");
    std::size_t plausible = 0;
    for (const float v : found.values) {
        ASSERT_FALSE(std::isnan(v));
        EXPECT_LE(v, 13.97f);  // the largest that is told of the file
        plausible += v > 5;
    }
    EXPECT_GT(plausible, found.values.size() * 9 / 10);
    // On its own voxel size of 1 Å the map covers a corner of the surface at most.
    resolution.map.frame.axes = Mat3d::Identity();
    std::size_t outside = 0;
    for (const float v : sample_at_vertices(mesh, resolution.map, "resolution").values)
        outside += std::isnan(v);
    EXPECT_GT(outside, found.values.size() / 2);
}

}  // namespace
}  // namespace vdbgeo
