// The yardstick itself: shapes, their exact curvature, and how near to the surface the points of a mesh lie.
#include "vdbgeo/measure/analytic_patches.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "tests/support/sound_mesh.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;

namespace {

struct AtOrigin {
    PatchShape shape;
    double k1, k2;
};
const AtOrigin at_origin[] = {{PatchShape::peak, 1, 1},
                              {PatchShape::pit, -1, -1},
                              {PatchShape::ridge, 1, 0},
                              {PatchShape::valley, 0, -1},
                              {PatchShape::saddle_ridge, 0.8, -0.4},
                              {PatchShape::saddle_valley, 0.4, -0.8},
                              {PatchShape::minimal, 1, -1},
                              {PatchShape::torus_outside, 1 / 1.3, 1 / 3.9},
                              {PatchShape::torus_inside, 1 / 1.3, -1 / 1.3}};

AnalyticPatch patch_of(PatchShape shape, double edge, double jitter = 0) {
    AnalyticPatchOptions options;
    options.shape = shape;
    options.max_edge = edge;
    options.jitter = jitter;
    return analytic_patch(options);
}

}  // namespace

TEST(AnalyticPatches, HaveTheCurvatureOfTheirShape) {
    for (const AtOrigin& a : at_origin) {
        Curvatures c;
        c.resize(1, true);
        set_graph_curvature(c, 0, graph_point(a.shape, 0, 0));
        EXPECT_NEAR(c.k1[0], a.k1, 1e-14) << name_of(a.shape);
        EXPECT_NEAR(c.k2[0], a.k2, 1e-14) << name_of(a.shape);
    }
}

TEST(AnalyticPatches, DerivativesAreThoseOfTheHeight) {
    const double h = 1e-4;
    for (const AtOrigin& a : at_origin) {
        const double x = 0.31, y = -0.17;
        const GraphPoint p = graph_point(a.shape, x, y);
        const auto z = [&](double i, double j) { return graph_point(a.shape, x + i * h, y + j * h).z; };
        EXPECT_NEAR(p.fx, (z(1, 0) - z(-1, 0)) / (2 * h), 1e-7) << name_of(a.shape);
        EXPECT_NEAR(p.fy, (z(0, 1) - z(0, -1)) / (2 * h), 1e-7) << name_of(a.shape);
        EXPECT_NEAR(p.fxx, (z(1, 0) - 2 * p.z + z(-1, 0)) / (h * h), 1e-6) << name_of(a.shape);
        EXPECT_NEAR(p.fyy, (z(0, 1) - 2 * p.z + z(0, -1)) / (h * h), 1e-6) << name_of(a.shape);
        EXPECT_NEAR(p.fxy, (z(1, 1) - z(1, -1) - z(-1, 1) + z(-1, -1)) / (4 * h * h), 1e-6)
            << name_of(a.shape);
    }
}

// Known in closed form away from the origin: K of the catenoid, and its H, which is 0.
TEST(AnalyticPatches, TheCatenoidIsMinimal) {
    Curvatures c;
    c.resize(1, true);
    for (const double y : {-0.4, 0.1, 0.5}) {
        set_graph_curvature(c, 0, graph_point(PatchShape::minimal, 0.3, y));
        EXPECT_NEAR(c.K[0], -std::pow(std::cosh(y), -4), 1e-14);
        EXPECT_NEAR(c.H[0], 0, 1e-14);
    }
}

// Along its direction a surface bends by the principal value: the height over the tangent plane is −k t²/2.
TEST(AnalyticPatches, DirectionsAreTangentAndPrincipal) {
    for (const AtOrigin& a : at_origin) {
        const double x = 0.12, y = 0.21, t = 1e-3;
        const GraphPoint p = graph_point(a.shape, x, y);
        const Vec3d normal = Vec3d(-p.fx, -p.fy, 1).normalized(), at(x, y, p.z);
        Curvatures c;
        c.resize(1, true);
        set_graph_curvature(c, 0, p);
        const auto bend = [&](const Vec3f& direction) {
            double height = 0;
            for (const double side : {-t, t}) {
                const Vec3d q = at + side * direction.cast<double>();
                height += (Vec3d(q.x(), q.y(), graph_point(a.shape, q.x(), q.y()).z) - at).dot(normal);
            }
            return -height / (t * t);
        };
        EXPECT_NEAR(c.direction1[0].cast<double>().dot(normal), 0, 1e-7) << name_of(a.shape);
        EXPECT_NEAR(c.direction1[0].dot(c.direction2[0]), 0, 1e-7) << name_of(a.shape);
        EXPECT_NEAR(bend(c.direction1[0]), c.k1[0], 1e-3) << name_of(a.shape);
        EXPECT_NEAR(bend(c.direction2[0]), c.k2[0], 1e-3) << name_of(a.shape);
    }
}

TEST(AnalyticPatches, FieldsAreZeroOnTheSurfaceAndPositiveBelow) {
    for (const AtOrigin& a : at_origin)
        for (const double x : {-0.3, 0.0, 0.2})
            for (const double y : {-0.25, 0.1}) {
                const double z = graph_point(a.shape, x, y).z;
                EXPECT_NEAR(patch_field(a.shape, {x, y, z}), 0, 1e-14) << name_of(a.shape);
                EXPECT_GT(patch_field(a.shape, {x, y, z - 0.1}), 0.05) << name_of(a.shape);
                EXPECT_LT(patch_field(a.shape, {x, y, z + 0.1}), -0.05) << name_of(a.shape);
            }
}

TEST(AnalyticPatches, LongestEdgesAreAsAsked) {
    for (const AtOrigin& a : at_origin) {
        EXPECT_NEAR(patch_of(a.shape, 0.05).longest_edge, 0.05, 5e-7) << name_of(a.shape);
        EXPECT_NEAR(patch_of(a.shape, 0.05, 0.2).longest_edge, 0.05, 2e-4) << name_of(a.shape);
    }
}

// What makes errors of 1e-6 visible at edges of 0.0125 Å: rounding points near 0.2 to floats leaves them 1e-9
// off.
TEST(AnalyticPatches, PointsLieNearerToTheSurfaceThanFloatsNeed) {
    for (const AtOrigin& a : at_origin)
        for (const double jitter : {0.0, 0.2}) {
            const AnalyticPatch patch = patch_of(a.shape, 0.0125, jitter);
            double off = 0;
            for (const VertexId v : patch.measured) {
                const Vec3d p = patch.mesh.points[v].cast<double>();
                off += std::abs(graph_point(a.shape, p.x(), p.y()).z - p.z());
            }
            EXPECT_LT(off / static_cast<double>(patch.measured.size()), 1e-10) << name_of(a.shape) << jitter;
        }
}

TEST(AnalyticPatches, MeasuredVerticesHaveThreeRingsAroundThem) {
    const AnalyticPatch patch = patch_of(PatchShape::saddle_ridge, 0.1, 0.2);
    std::map<std::pair<VertexId, VertexId>, int> faces_at;
    for (const Triangle& t : patch.mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) ++faces_at[std::minmax(t[k], t[(k + 1) % 3])];
    std::set<VertexId> near;  // what is within two edges of the border
    for (const auto& [edge, faces] : faces_at)
        if (faces == 1) near.insert({edge.first, edge.second});
    for (int ring = 0; ring < 2; ++ring) {
        const std::set<VertexId> before = near;
        for (const auto& [edge, faces] : faces_at)
            if (before.count(edge.first) || before.count(edge.second)) near.insert({edge.first, edge.second});
    }
    EXPECT_GT(patch.measured.size(), 15u);
    for (const VertexId v : patch.measured) EXPECT_EQ(near.count(v), 0u);
}

TEST(AnalyticPatches, ANeighbourhoodWithoutValuesIsAnInfiniteError) {
    const AnalyticPatch patch = patch_of(PatchShape::peak, 0.1);
    EXPECT_EQ(curvature_errors(patch, patch.exact).K_max, 0);
    Curvatures holed = patch.exact;
    holed.set_undefined(patch.measured[3]);
    EXPECT_EQ(curvature_errors(patch, holed).H_rms, std::numeric_limits<double>::infinity());
}

TEST(AnalyticPatches, RefuseWhatTheShapesDoNotReach) {
    const auto with = [](double edge, double radius, int margin, double jitter) {
        AnalyticPatchOptions o;
        o.max_edge = edge;
        o.radius = radius;
        o.margin = margin;
        o.jitter = jitter;
        return o;
    };
    EXPECT_NO_THROW(with(0.1, 0.2, 3, 0.2).check());
    for (const AnalyticPatchOptions& bad :
         {with(0, 0.2, 3, 0), with(0.1, 0, 3, 0), with(0.1, 0.2, 0, 0), with(0.1, 0.2, 3, 0.3),
          with(0.1, 0.8, 3, 0), with(NAN, 0.2, 3, 0)})
        EXPECT_THROW(analytic_patch(bad), InvalidInput);
    EXPECT_THROW(patch_map(PatchShape::peak, 0.2, 0.2), InvalidInput);
    EXPECT_THROW(geodesic_sphere(1, 0), InvalidInput);
}

TEST(GeodesicSphere, IsClosedEvenAndOnTheSphere) {
    for (const int frequency : {1, 2, 7}) {
        const TriMesh mesh = geodesic_sphere(2, frequency);
        EXPECT_EQ(mesh.points.size(), static_cast<std::size_t>(10 * frequency * frequency + 2));
        EXPECT_EQ(mesh.triangles.size(), static_cast<std::size_t>(20 * frequency * frequency));
        const MeshMeasures measures = test::expect_closed_manifold(mesh);
        EXPECT_GT(measures.volume_A3.value(), 0.6 * 4 * M_PI / 3 * 8);
        double shortest = 1e9, longest = 0;
        for (const Triangle& t : mesh.triangles) {
            const double length = (mesh.points[t[0]] - mesh.points[t[1]]).cast<double>().norm();
            shortest = std::min(shortest, length);
            longest = std::max(longest, length);
        }
        for (const Vec3f& p : mesh.points) EXPECT_NEAR(p.cast<double>().norm(), 2, 3e-7);
        EXPECT_LT(longest, 1.25 * shortest);
    }
}
