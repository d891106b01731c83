#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <random>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/remesh/mesh_diffusion.h"
#include "vdbgeo/remesh/taubin_smooth.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

double volume(const TriMesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        sum += mesh.points[t[0]].cast<double>().dot(
                   mesh.points[t[1]].cast<double>().cross(mesh.points[t[2]].cast<double>())) /
               6;
    return sum;
}

double area(const TriMesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        sum += (mesh.points[t[1]] - mesh.points[t[0]])
                   .cross(mesh.points[t[2]] - mesh.points[t[0]])
                   .cast<double>()
                   .norm() /
               2;
    return sum;
}

/// Rms of the distances from the origin about their mean.
double roughness(const TriMesh& mesh) {
    double sum = 0, squares = 0;
    for (const Vec3f& p : mesh.points) {
        const double r = p.cast<double>().norm();
        sum += r;
        squares += r * r;
    }
    const double n = static_cast<double>(mesh.points.size());
    return std::sqrt(squares / n - sum * sum / (n * n));
}

TriMesh noisy_sphere(double amplitude) {
    TriMesh mesh = icosphere(5, 10);
    std::mt19937 random(5);
    for (Vec3f& p : mesh.points)
        p *= static_cast<float>(1 + amplitude / 10 * (double(random()) / 0x80000000u - 1));
    return mesh;
}

/// r = 10 + height · Y with six-fold bumps.
TriMesh bumpy_sphere(double height) {
    TriMesh mesh = icosphere(4, 10);
    for (Vec3f& p : mesh.points) {
        const Vec3d u = p.cast<double>().normalized();
        p = (u * (10 + height * std::sin(6 * std::atan2(u.y(), u.x())) * std::pow(1 - u.z() * u.z(), 3)))
                .cast<float>();
    }
    return mesh;
}

/// A can whose lids are caps, wavy on the wall.
TriMesh wavy_can() {
    TriMesh mesh = open_cylinder_mesh(10, 30);
    for (std::size_t v = 96; v + 96 < mesh.points.size(); ++v) {
        const float swell = 1 + 0.05f * std::sin(1.3f * static_cast<float>(v % 96));
        mesh.points[v].head<2>() *= swell;
    }
    MeshProperty cap{cap_property, 1, std::vector<float>(mesh.triangles.size(), 0)};
    for (const VertexId end : {0u, 24u}) {
        const VertexId middle = static_cast<VertexId>(mesh.points.size());
        mesh.points.push_back(Vec3f(0, 0, end ? 15.0f : -15.0f));
        for (VertexId c = 0; c < 96; ++c) {
            const VertexId u = end * 96 + c, v = end * 96 + (c + 1) % 96;
            mesh.triangles.push_back(end ? Triangle{u, v, middle} : Triangle{v, u, middle});
            cap.values.push_back(1);
        }
    }
    mesh.face_properties.push_back(cap);
    return mesh;
}

TriMesh diffused(const TriMesh& mesh, double time, int steps) {
    MeshDiffusionOptions options;
    options.time = time;
    options.steps = steps;
    return mesh_diffusion(mesh, options);
}

/// The borders of an open cylinder and the lids of a can.
void expect_ends_kept(const TriMesh& before, const TriMesh& after) {
    for (std::size_t v = 0; v < before.points.size(); ++v)
        if (std::abs(std::abs(before.points[v].z()) - 15) < 1e-3f) {
            EXPECT_EQ(before.points[v], after.points[v]);
        }
}

}  // namespace

TEST(TaubinSmooth, NoiseFallsAndTheVolumeStays) {
    const TriMesh noisy = noisy_sphere(0.2), smooth = taubin_smooth(noisy);
    EXPECT_GT(roughness(noisy), 0.1);
    EXPECT_LT(roughness(smooth), 0.4 * roughness(noisy));
    EXPECT_NEAR(volume(smooth), volume(noisy), 0.01 * volume(noisy));
    TaubinOptions longer;
    longer.iterations = 100;
    EXPECT_NEAR(volume(taubin_smooth(noisy, longer)), volume(noisy), 0.01 * volume(noisy));
}

TEST(TaubinSmooth, OnePairOnOneVertexByHand) {
    // An octahedron whose top is pulled up: the mean of its ring is the origin.
    TriMesh mesh;
    mesh.points = {Vec3f(1, 0, 0),  Vec3f(0, 1, 0), Vec3f(-1, 0, 0),
                   Vec3f(0, -1, 0), Vec3f(0, 0, 2), Vec3f(0, 0, -1)};
    for (VertexId i = 0; i < 4; ++i) {
        mesh.triangles.push_back({i, (i + 1) % 4, 4});
        mesh.triangles.push_back({(i + 1) % 4, i, 5});
    }
    TaubinOptions options;
    options.iterations = 1;
    const double mu = 1 / (0.1 - 2.0);
    // Heights after the first step: top 2 − 0.5·2 = 1, bottom −0.5, ring 0.5·(2 − 1)/4 = 0.125.
    EXPECT_NEAR(taubin_smooth(mesh, options).points[4].z(), 1 + mu * (0.125 - 1), 1e-6);
}

TEST(TaubinSmooth, NothingForNothing) {
    TaubinOptions none;
    none.iterations = 0;
    const TriMesh mesh = noisy_sphere(0.2);
    EXPECT_EQ(taubin_smooth(mesh, none).points, mesh.points);
    EXPECT_TRUE(taubin_smooth(TriMesh()).empty());
}

TEST(TaubinSmooth, BordersRimsAndPropertiesStay) {
    const TriMesh pipe = open_cylinder_mesh(10, 30);
    expect_ends_kept(pipe, taubin_smooth(pipe));
    TriMesh can = wavy_can();
    can.vertex_properties.push_back({"number", 1, std::vector<float>(can.points.size(), 7)});
    const TriMesh smooth = taubin_smooth(can);
    expect_ends_kept(can, smooth);
    EXPECT_NE(smooth.points[200], can.points[200]);
    EXPECT_EQ(smooth.triangles, can.triangles);
    EXPECT_EQ(smooth.vertex_properties[0].values, can.vertex_properties[0].values);
    EXPECT_EQ(smooth.face_properties[0].values, can.face_properties[0].values);
}

TEST(TaubinSmooth, RefusesFiltersThatGrow) {
    const TriMesh mesh = icosphere(1, 1);
    const auto with = [](int iterations, double lambda, double pass_band) {
        TaubinOptions options;
        options.iterations = iterations;
        options.lambda = lambda;
        options.pass_band = pass_band;
        return options;
    };
    EXPECT_THROW(taubin_smooth(mesh, with(-1, 0.5, 0.1)), InvalidInput);
    EXPECT_THROW(taubin_smooth(mesh, with(1, 0, 0.1)), InvalidInput);
    EXPECT_THROW(taubin_smooth(mesh, with(1, 0.5, 2)), InvalidInput);
    EXPECT_THROW(taubin_smooth(mesh, with(1, 0.5, 0)), InvalidInput);
    EXPECT_THROW(taubin_smooth(mesh, with(1, 0.95, 0.1)), InvalidInput);
}

TEST(MeshDiffusion, SpheresRest) {
    const TriMesh sphere = icosphere(4, 10), after = diffused(sphere, 100, 5);
    float most = 0;
    for (std::size_t v = 0; v < sphere.points.size(); ++v)
        most = std::max(most, (sphere.points[v] - after.points[v]).norm());
    EXPECT_LT(most, 0.02f);
    EXPECT_NEAR(volume(after), volume(sphere), 1e-4 * volume(sphere));
}

TEST(MeshDiffusion, WavesDecayAsTheyShould) {
    // On a sphere of radius R a harmonic of degree l decays at the rate (l − 1) l (l + 1) (l + 2) / R⁴.
    const double rate = 2.0 * 3 * 4 * 5 / 1e4, time = 20, height = 0.05;
    TriMesh mesh = icosphere(4, 10);
    const auto harmonic = [](const Vec3d& u) { return u.x() * u.y() * u.z() * 5.196152422706632; };
    for (Vec3f& p : mesh.points) {
        const Vec3d u = p.cast<double>().normalized();
        p = (u * (10 + height * harmonic(u))).cast<float>();
    }
    const auto amplitude = [&](const TriMesh& m) {
        double with = 0, norm = 0;
        for (const Vec3f& p : m.points) {
            const Vec3d u = p.cast<double>().normalized();
            with += (p.cast<double>().norm() - 10) * harmonic(u);
            norm += harmonic(u) * harmonic(u);
        }
        return with / norm;
    };
    const double left = amplitude(diffused(mesh, time, 20)) / amplitude(mesh);
    EXPECT_NEAR(left, std::exp(-rate * time), 0.02);
}

TEST(MeshDiffusion, BumpsGoAndTheVolumeStays) {
    const TriMesh bumpy = bumpy_sphere(1), round = diffused(bumpy, 200, 40);
    EXPECT_LT(roughness(round), 0.04 * roughness(bumpy));
    EXPECT_NEAR(volume(round), volume(bumpy), 0.005 * volume(bumpy));
    EXPECT_LT(area(round), area(bumpy));
}

TEST(MeshDiffusion, NoiseFalls) {
    const TriMesh noisy = noisy_sphere(0.2), smooth = diffused(noisy, 1, 3);
    EXPECT_LT(roughness(smooth), 0.25 * roughness(noisy));
    EXPECT_NEAR(volume(smooth), volume(noisy), 0.005 * volume(noisy));
}

TEST(MeshDiffusion, BordersRimsAndPropertiesStay) {
    const TriMesh pipe = open_cylinder_mesh(10, 30), rested = diffused(pipe, 50, 2);
    expect_ends_kept(pipe, rested);
    for (std::size_t v = 0; v < pipe.points.size(); ++v)
        EXPECT_LT((pipe.points[v] - rested.points[v]).norm(), 0.01f);
    const TriMesh can = wavy_can(), smooth = diffused(can, 10, 2);
    expect_ends_kept(can, smooth);
    EXPECT_LT(area(smooth), area(can));
    EXPECT_EQ(smooth.triangles, can.triangles);
    EXPECT_EQ(smooth.face_properties[0].values, can.face_properties[0].values);
}

TEST(MeshDiffusion, NothingForNothing) {
    const TriMesh mesh = noisy_sphere(0.2);
    EXPECT_EQ(diffused(mesh, 0, 1).points, mesh.points);
    EXPECT_TRUE(diffused(TriMesh(), 1, 1).empty());
    EXPECT_THROW(diffused(mesh, -1, 1), InvalidInput);
    EXPECT_THROW(diffused(mesh, std::nan(""), 1), InvalidInput);
    EXPECT_THROW(diffused(mesh, 1, 0), InvalidInput);
}

TEST(Smoothing, TheSameForAnyNumberOfThreads) {
    const TriMesh mesh = noisy_sphere(0.2);
    TriMesh taubin[2], diffusion[2];
    for (std::size_t threads = 1; threads <= 2; ++threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        taubin[threads - 1] = taubin_smooth(mesh);
        diffusion[threads - 1] = diffused(mesh, 1, 1);
    }
    EXPECT_EQ(taubin[0].points, taubin[1].points);
    EXPECT_EQ(diffusion[0].points, diffusion[1].points);
}
