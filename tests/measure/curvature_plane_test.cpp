// The area over k1 and k2.
#include "vdbgeo/measure/curvature_plane.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/jet_curvature.h"
#include "vdbgeo/measure/vertex_areas.h"

using namespace vdbgeo;

namespace {

constexpr std::size_t side = 40;

struct Cells {
    CurvaturePlane plane;
    Array<double> areas;

    explicit Cells(const TriMesh& mesh) : areas(vertex_areas(mesh)) {
        plane = curvature_plane(jet_curvature(mesh), areas, side);
    }
    double sum() const { return std::accumulate(plane.area.begin(), plane.area.end(), 0.0); }
    /// Part of the area within one cell of (k1, k2).
    double share_at(double k1, double k2) const {
        const std::size_t at = plane.cell(k1, k2), x = at % side, y = at / side;
        double area = 0;
        for (std::size_t j = y - std::min<std::size_t>(1, y); j <= std::min(side - 1, y + 1); ++j)
            for (std::size_t i = x - std::min<std::size_t>(1, x); i <= std::min(side - 1, x + 1); ++i)
                area += plane.area[j * side + i];
        return area / plane.all;
    }
};

/// z = (x² − y²)/(2 radius) over a square about the origin.
TriMesh saddle(double radius, double half, int n) {
    TriMesh mesh;
    for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i) {
            const double x = half * (2.0 * i / n - 1), y = half * (2.0 * j / n - 1);
            mesh.points.push_back(Vec3d(x, y, (x * x - y * y) / (2 * radius)).cast<float>());
        }
    const auto id = [&](int i, int j) { return static_cast<VertexId>(j * (n + 1) + i); };
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            mesh.triangles.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
            mesh.triangles.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
        }
    return mesh;
}

}  // namespace

TEST(CurvaturePlane, ASphereIsOnePeak) {
    const Cells c(test::icosphere(4, 20));
    EXPECT_NEAR(c.sum() + c.plane.outside, c.plane.all, 1e-9 * c.plane.all);
    EXPECT_NEAR(c.plane.all, 4 * M_PI * 400, 0.01 * 4 * M_PI * 400);
    EXPECT_GT(c.share_at(0.05, 0.05), 0.98);
    EXPECT_NEAR(c.plane.high, 0.05 * 1.05, 0.003);
    EXPECT_NEAR(c.plane.low, -0.05 * 0.05, 0.001);  // 0 lies in the plane
}

TEST(CurvaturePlane, TurnedOverItIsOnePit) {
    const Cells c(test::flipped(test::icosphere(4, 20)));
    EXPECT_GT(c.share_at(-0.05, -0.05), 0.98);
    EXPECT_GT(c.plane.high, 0);
}

TEST(CurvaturePlane, ATorusHasOneK1AndARangeOfK2) {
    const Cells c(test::torus_mesh(12, 4));
    const std::size_t column = c.plane.cell(0.25, 0) % side;
    double in_column = 0, convex = 0;
    for (std::size_t y = 0; y < side; ++y)
        for (std::size_t x = 0; x < side; ++x) {
            const double area = c.plane.area[y * side + x];
            if (x + 1 >= column && x <= column + 1) in_column += area;
            if (y > c.plane.cell(0.25, 0) / side) convex += area;
        }
    EXPECT_GT(in_column / c.plane.all, 0.97);
    // The outer half has the area 2π² ring tube + 4π tube², the whole 4π² ring tube.
    const double half = 2 * M_PI * M_PI * 12 * 4, more = 4 * M_PI * 16;
    EXPECT_NEAR(convex / c.plane.all, (half + more) / (2 * half), 0.06);
}

TEST(CurvaturePlane, ASaddleIsMinimal) {
    const Cells c(saddle(50, 6, 40));
    EXPECT_GT(c.share_at(0.02, -0.02), 0.8);
}

TEST(CurvaturePlane, UndefinedVerticesAndOutliersAreLeftOut) {
    Curvatures curvature;
    curvature.resize(1000, false);
    for (std::size_t v = 0; v < 1000; ++v) {
        curvature.flags[v] = 0;
        curvature.set_from_principal(v, 0.2, 0.1);
    }
    curvature.set_undefined(3);
    curvature.set_from_principal(4, 50.0, 0.1);
    const CurvaturePlane plane = curvature_plane(curvature, Array<double>(1000, 2.0), 10);
    EXPECT_EQ(plane.all, 2.0 * 999);
    EXPECT_EQ(plane.outside, 2.0);
    EXPECT_EQ(plane.area[plane.cell(0.2, 0.1)], 2.0 * 998);
    EXPECT_THROW(curvature_plane(curvature, Array<double>(3, 1.0), 10), InvalidInput);
    EXPECT_THROW(curvature_plane(curvature, Array<double>(1000, 1.0), 0), InvalidInput);
    Curvatures flat;
    flat.resize(5, false);
    for (std::size_t v = 0; v < 5; ++v) flat.flags[v] = 0, flat.set_from_principal(v, 0, 0);
    const CurvaturePlane none = curvature_plane(flat, Array<double>(5, 1.0), 11);
    EXPECT_LT(none.low, 0);
    EXPECT_GT(none.high, 0);
    EXPECT_EQ(none.area[none.cell(0, 0)], 5.0);
}
