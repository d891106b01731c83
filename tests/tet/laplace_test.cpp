// The meshes are such that finite elements converge on them at the rate that theory gives.
#include "tests/support/laplace.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/meshes.h"
#include "vdbgeo/tet/netgen_tetrahedra.h"
#include "vdbgeo/tet/tetgen_tetrahedra.h"

namespace vdbgeo {
namespace {

/// Between spheres of radius 1 and 2 with 1 inside and 0 outside: harmonic, 8π flow through any sphere
/// between.
double exact(const Vec3d& p) { return 2 / p.norm() - 1; }

TriMesh shell(int level) {
    return test::joined(test::icosphere(level + 1, 2), test::flipped(test::icosphere(level, 1)));
}

/// Edges as long as those of the surfaces.
double edge(int level) { return 1.1 * std::pow(0.5, level); }

struct Solved {
    double error, flux;
    std::size_t tets;
};

Solved solve(const TetMesh& mesh) {
    const auto on_boundary = [](const Vec3d& p) { return p.norm() < 1.5 ? 1.0 : 0.0; };
    const test::LaplaceSolution solution = test::solve_laplace(mesh, on_boundary);
    double flux = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        if (mesh.points[v].norm() < 1.0001) flux += solution.flux[Eigen::Index(v)];
    return {test::l2_error(mesh, solution.values, exact), flux, mesh.tets.size()};
}

void expect_second_order(const std::vector<Solved>& solved) {
    for (std::size_t i = 0; i < solved.size(); ++i) {
        std::printf("%zu tetrahedra: error %.3g, flow %.5g of %.5g\n", solved[i].tets, solved[i].error,
                    solved[i].flux, 8 * M_PI);
        if (i == 0) continue;
        EXPECT_GE(std::log2(solved[i - 1].error / solved[i].error), 1.8) << i;
        EXPECT_LT(std::abs(solved[i].flux - 8 * M_PI), 0.5 * std::abs(solved[i - 1].flux - 8 * M_PI)) << i;
    }
    EXPECT_NEAR(solved.back().flux / (8 * M_PI), 1, 0.02);
}

TEST(Laplace, ConvergesOnMeshesOfTetgen) {
    if (!have_tetgen()) GTEST_SKIP() << "this build has no TetGen";
    std::vector<Solved> solved;
    for (const int level : {1, 2, 3}) {
        TetgenOptions options;
        options.size = [h = edge(level)](const Vec3d& p) { return h * p.norm(); };
        solved.push_back(solve(tetgen_tetrahedra(shell(level), options)));
    }
    expect_second_order(solved);
}

TEST(Laplace, ConvergesOnMeshesOfNetgen) {
    if (!have_netgen()) GTEST_SKIP() << "this build has no NetGen";
    std::vector<Solved> solved;
    for (const int level : {1, 2}) solved.push_back(solve(netgen_tetrahedra(shell(level))));
    expect_second_order(solved);
}

/// Linear functions are solved to rounding, whatever the mesh.
TEST(Laplace, LinearFunctionsAreExact) {
    if (!have_tetgen()) GTEST_SKIP() << "this build has no TetGen";
    const auto linear = [](const Vec3d& p) { return 3 + p.dot(Vec3d(1, -2, 0.5)); };
    const TetMesh mesh = tetgen_tetrahedra(shell(1));
    EXPECT_LT(test::l2_error(mesh, test::solve_laplace(mesh, linear).values, linear), 1e-12);
}

}  // namespace
}  // namespace vdbgeo
