#include "vdbgeo/measure/surface_distance.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

/// A square [0, side]² at height z, in `cells`² quads.
TriMesh square(double side, int cells, double z) {
    TriMesh mesh;
    for (int y = 0; y <= cells; ++y)
        for (int x = 0; x <= cells; ++x)
            mesh.points.push_back(Vec3d(side * x / cells, side * y / cells, z).cast<float>());
    for (int y = 0; y < cells; ++y)
        for (int x = 0; x < cells; ++x) {
            const auto at = [&](int i, int j) {
                return static_cast<VertexId>((y + j) * (cells + 1) + x + i);
            };
            mesh.triangles.push_back({at(0, 0), at(1, 0), at(1, 1)});
            mesh.triangles.push_back({at(0, 0), at(1, 1), at(0, 1)});
        }
    return mesh;
}

void expect_same(const OneSidedDistance& a, const OneSidedDistance& b) {
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.rms, b.rms);
    EXPECT_EQ(a.p999, b.p999);
    EXPECT_EQ(a.samples, b.samples);
}

}  // namespace

TEST(SurfaceDistance, ParallelPlanes) {
    const SurfaceDistance d = surface_distance(square(10, 4, 0), square(10, 7, 1.5));
    for (const OneSidedDistance& side : {d.forward, d.backward}) {
        EXPECT_NEAR(side.max, 1.5, 1e-12);
        EXPECT_NEAR(side.mean, 1.5, 1e-12);
        EXPECT_NEAR(side.rms, 1.5, 1e-12);
        EXPECT_NEAR(side.p999, 1.5, 1.5 / 2000);
    }
    EXPECT_NEAR(d.hausdorff, 1.5, 1e-12);
}

TEST(SurfaceDistance, TheSurfaceItselfIsAtDistanceZero) {
    const TriMesh torus = torus_mesh(20, 6);
    const SurfaceDistance d = surface_distance(torus, torus);
    EXPECT_LT(d.hausdorff, 1e-13);
    expect_same(d.forward, d.backward);
}

TEST(SurfaceDistance, ConcentricSpheres) {
    const SurfaceDistance d = surface_distance(icosphere(5, 10), icosphere(5, 12));
    EXPECT_NEAR(d.hausdorff, 2, 0.01);
    EXPECT_NEAR(d.forward.mean, 2, 0.01);
    EXPECT_NEAR(d.backward.rms, 2, 0.01);
}

TEST(SurfaceDistance, SidesDifferWhereOneSurfaceHasMore) {
    // The second mesh has a second sphere 30 Å away: seen from it only.
    const TriMesh one = icosphere(3, 5);
    const TriMesh two = joined(one, moved(icosphere(3, 5), Mat3d::Identity(), Vec3d(30, 0, 0)));
    const SurfaceDistance d = surface_distance(one, two);
    EXPECT_LT(d.forward.max, 1e-13);
    EXPECT_NEAR(d.backward.max, 30, 0.05);
    EXPECT_EQ(d.hausdorff, d.backward.max);
    const SurfaceDistance turned = surface_distance(two, one);
    expect_same(turned.forward, d.backward);
    expect_same(turned.backward, d.forward);
}

TEST(SurfaceDistance, MeansAreOverTheAreaAndQuantilesOverSamples) {
    // A wedge: distances to the plane z = 0 grow from 0 to h, evenly: mean h/2, rms h/√3.
    TriMesh wedge = square(10, 40, 0);
    for (Vec3f& p : wedge.points) p.z() = 0.1f * p.x();
    const SurfaceDistance d = surface_distance(wedge, square(30, 3, 0), {0.1});
    EXPECT_NEAR(d.forward.max, 1, 1e-6);
    EXPECT_NEAR(d.forward.mean, 0.5, 1e-3);
    EXPECT_NEAR(d.forward.rms, 1 / std::sqrt(3.0), 1e-3);
    EXPECT_NEAR(d.forward.p999, 0.999, 2e-3);
}

TEST(SurfaceDistance, SpacingFindsWhatLiesBetweenTheCorners) {
    // A tent over one big face: its ridge is over the middle, none of the face's corners sees it.
    TriMesh flat, tent;
    flat.points = {Vec3f(0, 0, 0), Vec3f(10, 0, 0), Vec3f(0, 10, 0)};
    flat.triangles = {{0, 1, 2}};
    tent.points = flat.points;
    tent.points.push_back(Vec3f(2, 2, 1));
    tent.triangles = {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    const SurfaceDistance coarse = surface_distance(flat, tent, {20.0}),
                          fine = surface_distance(flat, tent, {0.05});
    EXPECT_EQ(coarse.forward.samples, 4u);
    EXPECT_GT(fine.forward.samples, 10000u);
    EXPECT_LE(coarse.forward.max, fine.forward.max);
    EXPECT_LE(fine.forward.max, coarse.forward.max + 20.0 * 2 / 3);
    EXPECT_EQ(coarse.backward.max, 1);
}

TEST(SurfaceDistance, PointsThatNoFaceNamesDoNotCount) {
    TriMesh stray = icosphere(2, 5);
    stray.points.push_back(Vec3f(1000, 0, 0));
    EXPECT_LT(surface_distance(stray, icosphere(2, 5)).hausdorff, 1e-13);
}

TEST(SurfaceDistance, RefusesWhatHasNoDistance) {
    const TriMesh sphere = icosphere(1, 5);
    TriMesh points = sphere;
    points.triangles.clear();
    EXPECT_THROW(surface_distance(points, sphere), InvalidInput);
    EXPECT_THROW(surface_distance(sphere, TriMesh()), InvalidInput);
    TriMesh flat = sphere;
    for (Vec3f& p : flat.points) p = Vec3f(1, 2, 3);
    EXPECT_THROW(surface_distance(sphere, flat), InvalidInput);
    EXPECT_THROW(surface_distance(sphere, sphere, {0.0}), InvalidInput);
    EXPECT_THROW(surface_distance(sphere, sphere, {-1.0}), InvalidInput);
    EXPECT_THROW(surface_distance(sphere, sphere, {std::nan("")}), InvalidInput);
    EXPECT_THROW(surface_distance(sphere, sphere, {1e-9}), InvalidInput);
}

TEST(SurfaceDistance, TheSameForAnyNumberOfThreads) {
    const TriMesh a = torus_mesh(20, 6, 200, 100), b = torus_mesh(20, 6.3, 90, 50);
    std::optional<SurfaceDistance> results[2];
    for (std::size_t threads = 1; threads <= 2; ++threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        results[threads - 1] = surface_distance(a, b);
    }
    expect_same(results[0]->forward, results[1]->forward);
    expect_same(results[0]->backward, results[1]->backward);
}

TEST(SurfaceDistance, CanBeStopped) {
    const Progress stop([](double) { return false; });
    EXPECT_THROW(surface_distance(icosphere(3, 5), icosphere(3, 5), {}, stop), Cancelled);
}
