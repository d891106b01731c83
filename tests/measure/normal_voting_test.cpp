#include "vdbgeo/measure/normal_voting.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>

#include "converters/mesh_file.h"
#include "tests/support/data.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

NormalVotingOptions within(double radius) { return {radius}; }

/// The relative error that a share of the vertices stays below.
double error_quantile(const Array<double>& values, const Curvatures& c, double expected, double share) {
    std::vector<double> errors;
    for (std::size_t v = 0; v < c.size(); ++v)
        if (c.flags[v] == 0) errors.push_back(std::abs(values[v] / expected - 1));
    const auto nth = errors.begin() + std::ptrdiff_t(share * double(errors.size() - 1));
    std::nth_element(errors.begin(), nth, errors.end());
    return *nth;
}

TEST(NormalVoting, SphereIsUmbilicEverywhere) {
    const TriMesh mesh = test::icosphere(3, 10);
    const Curvatures out = voted_curvature(mesh, within(5));
    const Curvatures in = voted_curvature(test::flipped(mesh), within(5));
    for (std::size_t v = 0; v < out.size(); ++v) {
        EXPECT_NEAR(out.k1[v], 0.1, 0.004);
        EXPECT_NEAR(out.k2[v], 0.1, 0.004);
        EXPECT_NEAR(in.k1[v], -out.k2[v], 1e-9);
        EXPECT_NEAR(in.k2[v], -out.k1[v], 1e-9);
        EXPECT_EQ(out.flags[v], 0);
        EXPECT_NEAR(out.K[v], out.k1[v] * out.k2[v], 1e-15);
    }
}

TEST(NormalVoting, CylinderAndItsAxis) {
    const TriMesh mesh = test::open_cylinder_mesh(10, 60, 48, 48);
    const Curvatures c = voted_curvature(mesh, within(6));
    for (std::size_t v = 0; v < c.size(); ++v) {
        const Vec3d p = mesh.points[v].cast<double>();
        const Vec3d round = Vec3d(-p.y(), p.x(), 0).normalized();
        if (std::abs(p.z()) > 29.9) {
            EXPECT_EQ(c.flags[v], curvature_border);
            EXPECT_NEAR(c.k1[v], 0.1, 0.02);
        }
        if (std::abs(p.z()) > 18) continue;
        ASSERT_NEAR(c.k1[v], 0.1, 0.005);
        ASSERT_NEAR(c.k2[v], 0, 0.005);
        ASSERT_GT(std::abs(c.direction1[v].cast<double>().dot(round)), 0.999);
        ASSERT_GT(std::abs(c.direction2[v].z()), 0.999f);
    }
}

TEST(NormalVoting, Torus) {
    const double ring = 25, tube = 10;
    const TriMesh mesh = test::torus_mesh(ring, tube, 120, 48);
    const Curvatures c = voted_curvature(mesh, within(5));
    for (std::size_t v = 0; v < c.size(); ++v) {
        const Vec3d p = mesh.points[v].cast<double>();
        const double out = std::hypot(p.x(), p.y()) - ring;
        ASSERT_NEAR(c.k1[v], 0.1, 0.01);
        ASSERT_NEAR(c.k2[v], out / tube / (ring + out), 0.01);
        const Vec3d along = Vec3d(-p.y(), p.x(), 0).normalized();
        ASSERT_LT(std::abs(c.direction1[v].cast<double>().dot(along)), 0.03);
    }
}

TEST(NormalVoting, NormalsAreSmoothedBeforeCurvature) {
    // Ripples of 1 % of the radius, as short as edges: one ring would see nothing else.
    TriMesh mesh = test::icosphere(4, 10);
    for (std::size_t v = 0; v < mesh.points.size(); ++v) mesh.points[v] *= v % 2 ? 1.003f : 0.997f;
    const Curvatures c = voted_curvature(mesh, within(5));
    EXPECT_LT(error_quantile(c.k1, c, 0.1, 0.5), 0.05);
    EXPECT_LT(error_quantile(c.k2, c, 0.1, 0.5), 0.05);
}

TEST(NormalVoting, CapsHaveNoVote) {
    TriMesh mesh = test::open_cylinder_mesh(10, 30, 24, 48);
    const std::size_t faces = mesh.triangles.size();
    const Curvatures open = voted_curvature(mesh, within(6));
    for (const VertexId row : {0u, 24u})
        for (VertexId i = 1; i + 1 < 48; ++i) {
            Triangle t{row * 48, row * 48 + i, row * 48 + i + 1};
            if (row == 0) std::swap(t[1], t[2]);
            mesh.triangles.push_back(t);
        }
    mesh.face_properties.push_back({cap_property, 1, std::vector<float>(mesh.triangles.size(), 1.f)});
    std::fill_n(mesh.face_properties[0].values.begin(), faces, 0.f);
    const Curvatures closed = voted_curvature(mesh, within(6));
    EXPECT_EQ(open.k1, closed.k1);
    EXPECT_EQ(open.k2, closed.k2);
    EXPECT_EQ(open.flags, closed.flags);
}

TEST(NormalVoting, SmallAndOddMeshes) {
    EXPECT_EQ(voted_curvature({}).size(), 0u);
    TriMesh mesh = test::icosphere(1, 1);
    mesh.points.emplace_back(3.f, 3.f, 3.f);
    const Curvatures c = voted_curvature(mesh);
    EXPECT_EQ(c.flags.back(), curvature_undefined);
    EXPECT_TRUE(std::isnan(c.k1[c.size() - 1]));
    for (std::size_t v = 0; v + 1 < c.size(); ++v) EXPECT_TRUE(std::isfinite(c.k1[v]));
    // Nothing but the vertex itself within reach.
    const Curvatures alone = voted_curvature(test::icosphere(1, 1), within(1e-3));
    for (std::size_t v = 0; v < alone.size(); ++v) EXPECT_FALSE(alone.defined(v));
    EXPECT_THROW(voted_curvature(test::moebius(12)), InvalidInput);
    for (const double radius : {0.0, -1.0, std::nan(""), HUGE_VAL})
        EXPECT_THROW(voted_curvature(test::cube(), within(radius)), InvalidInput);
    EXPECT_THROW(voted_curvature(test::cube(), {}, Progress([](double) { return false; })), Cancelled);
}

TEST(NormalVoting, TheSameForAnyNumberOfThreads) {
    const TriMesh mesh = test::torus_mesh(25, 10, 60, 30);
    const auto with_threads = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return voted_curvature(mesh);
    };
    const Curvatures one = with_threads(1), two = with_threads(2);
    EXPECT_EQ(one.k1, two.k1);
    EXPECT_EQ(one.k2, two.k2);
    EXPECT_EQ(one.direction2, two.direction2);
}

TEST(NormalVoting, PyCurvsOwnSphere) {
    const char* name = "pycurv_curvature/smooth_sphere_r10.surface.vtk";
    VDBGEO_NEEDS_DATA(name);
    // Its normals point inward.
    const Curvatures c = voted_curvature(test::flipped(read_mesh(test::data_folder() / name)), within(9));
    for (const Array<double>* k : {&c.k1, &c.k2}) {
        EXPECT_LT(error_quantile(*k, c, 0.1, 0.5), 0.015);
        EXPECT_LT(error_quantile(*k, c, 0.1, 0.95), 0.04);
    }
}

/// PyCurv's values are those of the faces, and its normals point inward: k1 there is −k2 here.
TEST(NormalVoting, AgreesWithPyCurvOnACell) {
    const char* name = "pycurv_embryo/cell_10_T_10.AVV_rh10.vtp";
    VDBGEO_NEEDS_DATA(name);
    const TriMesh mesh = read_mesh(test::data_folder() / name);
    const Curvatures c = voted_curvature(mesh, within(10));
    for (const auto& [property, ours] : {std::pair("kappa_2", &c.k1), std::pair("kappa_1", &c.k2)}) {
        const MeshProperty* theirs = mesh.find_face_property(property);
        ASSERT_NE(theirs, nullptr);
        double x = 0, y = 0, xx = 0, yy = 0, xy = 0, squares = 0;
        const double n = double(mesh.triangles.size());
        for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
            const Triangle& t = mesh.triangles[f];
            const double a = ((*ours)[t[0]] + (*ours)[t[1]] + (*ours)[t[2]]) / 3, b = -theirs->values[f];
            x += a / n, y += b / n, xx += a * a / n, yy += b * b / n, xy += a * b / n;
            squares += (a - b) * (a - b) / n;
        }
        EXPECT_GT((xy - x * y) / std::sqrt((xx - x * x) * (yy - y * y)), 0.99) << property;
        EXPECT_LT(std::sqrt(squares), 0.16 * std::sqrt(yy - y * y)) << property;
    }
}

}  // namespace
}  // namespace vdbgeo
