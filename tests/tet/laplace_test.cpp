// The meshes are such that finite elements converge on them at the rate that theory gives.
#include "tests/support/laplace.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "tests/support/meshes.h"
#include "vdbgeo/tet/tetgen_tetrahedra.h"

namespace vdbgeo {
namespace {

/// Between spheres of radius 1 and 2 with 1 inside and 0 outside: harmonic, 8π flow through any sphere
/// between.
double exact(const Vec3d& p) { return 2 / p.norm() - 1; }

/// An icosahedron's faces parted into n² each, blown up to a sphere.
TriMesh geodesic_sphere(int n, double radius) {
    const TriMesh base = test::icosphere(0, 1);
    TriMesh mesh;
    std::map<std::array<long, 3>, VertexId> numbers;
    const auto vertex = [&](const Triangle& t, int i, int j) {
        Vec3d p = Vec3d::Zero();
        const int weights[3] = {n - i - j, i, j};
        for (std::size_t k = 0; k < 3; ++k) p += double(weights[k]) * base.points[t[k]].cast<double>();
        p = radius * p.normalized();
        const std::array<long, 3> key{std::lround(p.x() * 1e4), std::lround(p.y() * 1e4),
                                      std::lround(p.z() * 1e4)};
        const auto [at, fresh] = numbers.try_emplace(key, VertexId(mesh.points.size()));
        if (fresh) mesh.points.push_back(p.cast<float>());
        return at->second;
    };
    for (const Triangle& t : base.triangles)
        for (int i = 0; i < n; ++i)
            for (int j = 0; i + j < n; ++j) {
                mesh.triangles.push_back({vertex(t, i, j), vertex(t, i + 1, j), vertex(t, i, j + 1)});
                if (i + j + 1 < n)
                    mesh.triangles.push_back(
                        {vertex(t, i + 1, j), vertex(t, i + 1, j + 1), vertex(t, i, j + 1)});
            }
    return mesh;
}

/// Both spheres with edges of about 1.2/n.
TriMesh shell(int n) { return test::joined(geodesic_sphere(2 * n, 2), test::flipped(geodesic_sphere(n, 1))); }

struct Solved {
    int n;
    double error, flux;
};

Solved solve(int n, const TetMesh& mesh) {
    const auto on_boundary = [](const Vec3d& p) { return p.norm() < 1.5 ? 1.0 : 0.0; };
    const test::LaplaceSolution solution = test::solve_laplace(mesh, on_boundary);
    double flux = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        if (mesh.points[v].norm() < 1.0001) flux += solution.flux[Eigen::Index(v)];
    return {n, test::l2_error(mesh, solution.values, exact), flux};
}

/// The error falls with the square of the edges, and so does that of the flow through the inner sphere.
void expect_second_order(const std::vector<Solved>& solved) {
    for (std::size_t i = 0; i < solved.size(); ++i) {
        const Solved& s = solved[i];
        EXPECT_LT(std::abs(s.flux / (8 * M_PI) - 1), 0.3 / (s.n * s.n)) << s.n;
        if (i == 0) continue;
        const double order =
            std::log(solved[i - 1].error / s.error) / std::log(double(s.n) / solved[i - 1].n);
        EXPECT_GE(order, 1.8) << solved[i - 1].error << " at " << solved[i - 1].n << ", " << s.error << " at "
                              << s.n;
    }
}

TEST(Laplace, ConvergesOnMeshesOfTetgen) {
    if (!have_tetgen()) GTEST_SKIP() << "this build has no TetGen";
    std::vector<Solved> solved;
    for (const int n : {4, 6, 8}) {
        TetgenOptions options;
        options.size = [n](const Vec3d& p) { return 0.8 / n * p.norm(); };
        solved.push_back(solve(n, tetgen_tetrahedra(shell(n), options)));
    }
    expect_second_order(solved);
}

/// Linear functions are solved to rounding, whatever the mesh.
TEST(Laplace, LinearFunctionsAreExact) {
    if (!have_tetgen()) GTEST_SKIP() << "this build has no TetGen";
    const auto linear = [](const Vec3d& p) { return 3 + p.dot(Vec3d(1, -2, 0.5)); };
    const TetMesh mesh = tetgen_tetrahedra(shell(4));
    EXPECT_LT(test::l2_error(mesh, test::solve_laplace(mesh, linear).values, linear), 1e-12);
}

}  // namespace
}  // namespace vdbgeo
