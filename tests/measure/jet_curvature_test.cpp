#include "vdbgeo/measure/jet_curvature.h"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/support/meshes.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using test::icosphere;

/// A rows × rows grid over [−1, 1]² with every second row moved, lifted to z = height(x, y).
template <class Height>
TriMesh graph_mesh(int rows, const Height& height) {
    TriMesh mesh;
    const double h = 2.0 / rows;
    for (int r = 0; r <= rows; ++r)
        for (int c = 0; c <= rows; ++c) {
            const double x = -1 + h * c + (r % 2 ? 0.2 * h : 0), y = -1 + h * r;
            mesh.points.push_back(Vec3d(x, y, height(x, y)).cast<float>());
        }
    const auto id = [&](int r, int c) { return static_cast<VertexId>(r * (rows + 1) + c); };
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < rows; ++c) {
            mesh.triangles.push_back({id(r, c), id(r, c + 1), id(r + 1, c + 1)});
            mesh.triangles.push_back({id(r, c), id(r + 1, c + 1), id(r + 1, c)});
        }
    return mesh;
}

struct Errors {
    double K = 0, H = 0;
};

template <class Truth>
Errors largest_errors(const TriMesh& mesh, const Curvatures& c, const Truth& truth, double within) {
    Errors e;
    for (std::size_t v = 0; v < c.size(); ++v) {
        const Vec3d p = mesh.points[v].cast<double>();
        if (p.cwiseAbs().maxCoeff() > within) continue;
        const auto [K, H] = truth(p);
        EXPECT_TRUE(c.defined(v));
        e.K = std::max(e.K, std::abs(c.K[v] - K));
        e.H = std::max(e.H, std::abs(c.H[v] - H));
    }
    return e;
}

TEST(JetCurvature, IsExactOnPolynomialsOfTheDegreeOverTheirOwnPlane) {
    // At the origin the normal is z by symmetry of the faces' area normals only for even functions.
    const double a = 0.8, b = -0.35, s = 0.2;
    for (const int degree : {2, 4}) {
        const auto height = [&](double x, double y) {
            const double quartic =
                degree == 4 ? 0.3 * x * x * x * x - 0.2 * x * x * y * y + 0.1 * y * y * y * y : 0;
            return a / 2 * x * x + s * x * y + b / 2 * y * y + quartic;
        };
        TriMesh mesh;
        const int n = 4;
        const double h = 0.25;
        for (int r = -n; r <= n; ++r)
            for (int c = -n; c <= n; ++c)
                mesh.points.push_back(Vec3d(c * h, r * h, height(c * h, r * h)).cast<float>());
        const auto id = [&](int r, int c) { return static_cast<VertexId>(r * (2 * n + 1) + c); };
        for (int r = 0; r < 2 * n; ++r)
            for (int c = 0; c < 2 * n; ++c) {
                mesh.triangles.push_back({id(r, c), id(r, c + 1), id(r + 1, c + 1)});
                mesh.triangles.push_back({id(r, c), id(r + 1, c + 1), id(r + 1, c)});
            }
        JetOptions options;
        options.degree = degree;
        const Curvatures k = jet_curvature(mesh, options);
        const VertexId origin = id(n, n);
        // Positive where the surface bends away from the normal, +z here.
        const double root = std::hypot((a - b) / 2, s);
        EXPECT_NEAR(k.k1[origin], -(a + b) / 2 + root, 2e-6) << degree;
        EXPECT_NEAR(k.k2[origin], -(a + b) / 2 - root, 2e-6) << degree;
        // k1 runs along the axis of the smaller second derivative.
        Eigen::Matrix2d hessian;
        hessian << a, s, s, b;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(hessian);
        const Vec3d along(axes.eigenvectors()(0, 0), axes.eigenvectors()(1, 0), 0);
        EXPECT_NEAR(std::abs(along.dot(k.direction1[origin].cast<double>())), 1, 1e-5) << degree;
        EXPECT_NEAR(along.dot(k.direction2[origin].cast<double>()), 0, 1e-5) << degree;
    }
}

TEST(JetCurvature, SpheresArePositiveAndTurnedOverNegative) {
    const TriMesh mesh = icosphere(3, 2);
    const Curvatures out = jet_curvature(mesh), in = jet_curvature(test::flipped(mesh));
    for (std::size_t v = 0; v < out.size(); ++v) {
        EXPECT_NEAR(out.H[v], 0.5, 0.02);
        EXPECT_NEAR(out.k1[v], -in.k2[v], 1e-9);
        EXPECT_NEAR(out.direction1[v].dot(out.direction2[v]), 0, 1e-5);
        EXPECT_NEAR(out.direction1[v].norm(), 1, 1e-5);
        EXPECT_NEAR(out.direction1[v].dot(mesh.points[v].normalized()), 0, 0.02);
    }
}

TEST(JetCurvature, ErrorFallsWithTheOrderOfTheDegree) {
    const auto truth = [](const Vec3d& p) {
        const double x = p[0], y = -p[1], w = 1 + x * x + y * y;
        return std::pair(-1 / (w * w), -((1 + y * y) - (1 + x * x)) / (2 * w * std::sqrt(w)));
    };
    const auto saddle = [](double x, double y) { return (x * x - y * y) / 2; };
    for (const auto& [degree, order] : {std::pair(2, 0.95), std::pair(3, 1.9), std::pair(4, 3.0)}) {
        JetOptions options;
        options.degree = degree;
        options.rings = degree == 4 ? 3 : 2;
        Errors e[2];
        for (int i = 0; i < 2; ++i) {
            const TriMesh mesh = graph_mesh(20 << i, saddle);
            e[i] = largest_errors(mesh, jet_curvature(mesh, options), truth, 0.6);
        }
        EXPECT_GT(std::log2(e[0].K / e[1].K), order) << degree << ": " << e[0].K << " " << e[1].K;
    }
}

TEST(JetCurvature, ARadiusTakesThePlaceOfRings) {
    const TriMesh mesh = icosphere(3, 1);
    JetOptions by_rings, by_radius;
    by_rings.rings = 10;
    by_radius.radius = 0.35;
    const Curvatures a = jet_curvature(mesh, by_rings), b = jet_curvature(mesh, by_radius);
    // A parabola through much of a sphere bends more than one through a little.
    for (std::size_t v = 0; v < a.size(); ++v) EXPECT_GT(std::abs(a.H[v] - 1), std::abs(b.H[v] - 1));
}

TEST(JetCurvature, BordersAndCapsAreFlagged) {
    TriMesh mesh = test::open_cylinder_mesh(1, 2);
    const Curvatures open = jet_curvature(mesh);
    std::size_t borders = 0;
    for (std::size_t v = 0; v < open.size(); ++v) {
        borders += (open.flags[v] & curvature_border) != 0;
        EXPECT_NEAR(open.k1[v], 1, 0.03);
        EXPECT_NEAR(open.k2[v], 0, 0.03);
    }
    EXPECT_EQ(borders, 2 * 96u);
    // A lid of cap faces changes nothing of what is below it.
    const auto middle = static_cast<VertexId>(mesh.points.size());
    mesh.points.push_back({0, 0, 1});
    MeshProperty caps{cap_property, 1, std::vector<float>(mesh.triangles.size(), 0)};
    for (VertexId c = 0; c < 96; ++c) {
        mesh.triangles.push_back({24 * 96 + c, 24 * 96 + (c + 1) % 96, middle});
        caps.values.push_back(1);
    }
    mesh.face_properties.push_back(caps);
    const Curvatures capped = jet_curvature(mesh);
    for (std::size_t v = 0; v < open.size(); ++v) {
        EXPECT_EQ(capped.k1[v], open.k1[v]);
        EXPECT_EQ(capped.flags[v], open.flags[v]);
    }
    EXPECT_TRUE(capped.flags[middle] & curvature_cap);
    EXPECT_TRUE(std::isnan(capped.H[middle]));
}

TEST(JetCurvature, FewPointsLowerTheDegreeAndFewerStillAreUndefined) {
    JetOptions options;
    options.degree = 4;
    options.rings = 1;
    const TriMesh mesh = icosphere(3, 1);
    const Curvatures low = jet_curvature(mesh, options);
    for (std::size_t v = 0; v < low.size(); ++v) EXPECT_NEAR(low.H[v], 1, 0.05);
    const Curvatures none = jet_curvature(test::tetrahedron(), options);
    for (std::size_t v = 0; v < none.size(); ++v) {
        EXPECT_FALSE(none.defined(v));
        EXPECT_TRUE(std::isnan(none.K[v]));
        EXPECT_EQ(none.direction1[v], Vec3f(0, 0, 0));
    }
}

TEST(JetCurvature, DegenerateMeshes) {
    TriMesh mesh = icosphere(2, 1);
    mesh.triangles.push_back({0, 0, 11});
    mesh.points.push_back({5, 5, 5});
    const Curvatures k = jet_curvature(mesh);
    EXPECT_FALSE(k.defined(mesh.points.size() - 1));
    for (std::size_t v = 0; v + 1 < k.size(); ++v) EXPECT_NEAR(k.H[v], 1, 0.15) << v;
    EXPECT_EQ(jet_curvature(TriMesh{}).size(), 0u);
    EXPECT_EQ(
        jet_curvature(test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 1}}, {{0, 1, 2}, {1, 3, 2}}))
            .size(),
        4u);
}

TEST(JetCurvature, SameBytesForAnyNumberOfThreads) {
    const TriMesh mesh = icosphere(5, 1);
    const Curvatures two = jet_curvature(mesh);
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    const Curvatures one = jet_curvature(mesh);
    EXPECT_EQ(0, std::memcmp(one.K.data(), two.K.data(), one.size() * sizeof(double)));
    EXPECT_EQ(0, std::memcmp(one.direction1.data(), two.direction1.data(), one.size() * sizeof(Vec3f)));
}

TEST(JetCurvature, RefusesBadOptionsByName) {
    const auto refused = [](auto change, const char* word) {
        JetOptions options;
        change(options);
        try {
            options.check();
            ADD_FAILURE() << word;
        } catch (const InvalidInput& e) {
            EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
        }
    };
    refused([](JetOptions& o) { o.degree = 1; }, "degree 1");
    refused([](JetOptions& o) { o.degree = 5; }, "degree 5");
    refused([](JetOptions& o) { o.rings = 0; }, "0 rings");
    refused([](JetOptions& o) { o.radius = -1; }, "radius -1");
    refused([](JetOptions& o) { o.radius = std::numeric_limits<double>::quiet_NaN(); }, "radius nan");
}

}  // namespace
}  // namespace vdbgeo
