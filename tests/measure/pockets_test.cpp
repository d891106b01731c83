// Pockets and protrusions on surfaces of known curvature.
#include "vdbgeo/measure/pockets.h"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <set>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/vertex_neighbours.h"
#include "vdbgeo/measure/convex_hull.h"
#include "vdbgeo/measure/pocket_depth.h"
#include "vdbgeo/measure/sublevel_basins.h"
#include "vdbgeo/measure/vertex_areas.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

const double infinity = std::numeric_limits<double>::infinity();

using Field = std::function<double(const Vec3d&)>;

/// The principal curvatures of the level set of f through p, f rising outward: the eigenvalues of the Hessian
/// in the tangent plane over |∇f|, by differences.
std::pair<double, double> principal(const Field& f, const Vec3d& p, double h) {
    Vec3d g;
    Mat3d hessian;
    const auto at = [&](const Vec3d& step) { return f(p + step); };
    for (int i = 0; i < 3; ++i) {
        const Vec3d x = h * Vec3d::Unit(i);
        g[i] = (at(x) - at(-x)) / (2 * h);
        hessian(i, i) = (at(x) - 2 * f(p) + at(-x)) / (h * h);
        for (int j = 0; j < i; ++j) {
            const Vec3d y = h * Vec3d::Unit(j);
            hessian(i, j) = hessian(j, i) = (at(x + y) - at(x - y) - at(y - x) + at(-x - y)) / (4 * h * h);
        }
    }
    const Vec3d n = g.normalized(), u = n.unitOrthogonal(), v = n.cross(u);
    Eigen::Matrix2d shape;
    shape << u.dot(hessian * u), u.dot(hessian * v), u.dot(hessian * v), v.dot(hessian * v);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(shape / g.norm());
    return {solver.eigenvalues()[1], solver.eigenvalues()[0]};
}

Curvatures curvature_of(const TriMesh& mesh,
                        const std::function<std::pair<double, double>(const Vec3d&)>& k) {
    Curvatures c;
    c.resize(mesh.points.size(), false);
    c.flags = curvature_flags(mesh, "curvature");
    for (std::size_t v = 0; v < c.size(); ++v) {
        const auto [k1, k2] = k(mesh.points[v].cast<double>());
        if (c.defined(v))
            c.set_from_principal(v, k1, k2);
        else
            c.set_undefined(v);
    }
    return c;
}

const std::vector<Vec3d> dent_directions = {
    Vec3d(1, 0.1, 0).normalized(), Vec3d(-0.7, 0.7, 0.1).normalized(), Vec3d(0, -0.8, 0.6).normalized(),
    Vec3d(0.1, 0.2, -1).normalized(), Vec3d(0.2, 0.3, 0.93).normalized()};

/// A sphere of radius 50 whose radius is less by 9, 8 … Å at dents of 0.2 rad (more, if `sign` is −1).
double dented_radius(const Vec3d& d, double sign = 1) {
    double r = 50;
    for (std::size_t i = 0; i < dent_directions.size(); ++i) {
        const double chord2 = (d - dent_directions[i]).squaredNorm();
        r -= sign * (9 - double(i)) * std::exp(-chord2 / (2 * 0.2 * 0.2));
    }
    return r;
}

struct Shape {
    TriMesh mesh;
    Curvatures curvature;
};

Shape dented(int subdivisions = 5, double sign = 1) {
    Shape s;
    s.mesh = icosphere(subdivisions, 1);
    for (Vec3f& p : s.mesh.points) {
        const Vec3d d = p.cast<double>().normalized();
        p = (dented_radius(d, sign) * d).cast<float>();
    }
    const Field f = [&](const Vec3d& p) { return p.norm() - dented_radius(p.normalized(), sign); };
    s.curvature = curvature_of(s.mesh, [&](const Vec3d& p) { return principal(f, p, 0.05); });
    return s;
}

Shape torus(double ring, double tube, int around_ring = 160, int around_tube = 80) {
    Shape s;
    s.mesh = torus_mesh(ring, tube, around_ring, around_tube);
    s.curvature = curvature_of(s.mesh, [&](const Vec3d& p) {
        const double far = p.head<2>().norm();
        return std::pair(1 / tube, (far - ring) / tube / far);
    });
    return s;
}

/// A flat square of n × n cells from −1 to 1 with made-up k2; k1 = 0.
Shape sheet(int n, const std::function<double(double, double)>& k2, double edge = 1) {
    Shape s;
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x)
            s.mesh.points.emplace_back(float(edge * (2.0 * x / n - 1)), float(edge * (2.0 * y / n - 1)), 0.f);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const auto id = [&](int i, int j) { return VertexId((y + j) * (n + 1) + x + i); };
            s.mesh.triangles.push_back({id(0, 0), id(1, 0), id(1, 1)});
            s.mesh.triangles.push_back({id(0, 0), id(1, 1), id(0, 1)});
        }
    s.curvature = curvature_of(s.mesh, [&](const Vec3d& p) {
        const double k = k2(p.x(), p.y());
        return std::pair(std::max(0.0, k), std::min(0.0, k));
    });
    for (std::size_t v = 0; v < s.curvature.size(); ++v) {
        s.curvature.k2[v] = k2(double(s.mesh.points[v].x()), double(s.mesh.points[v].y()));
        s.curvature.k1[v] = std::max(0.0, s.curvature.k2[v]);
    }
    return s;
}

/// Without CGAL depths are those below a ball.
PocketOptions with_depth(PocketOptions options, double radius = 200) {
    if (!have_convex_hull() && !options.ambient_radius) options.ambient_radius = radius;
    return options;
}

Pockets pockets(const Shape& s, const PocketOptions& options = {}) {
    return find_pockets(s.mesh, s.curvature, with_depth(options));
}

PocketOptions below(double k2, double min_area = 0, double persistence = infinity) {
    PocketOptions o;
    o.k2_below = k2;
    o.k1_below = infinity;
    o.min_area = min_area;
    o.min_persistence = persistence;
    return o;
}

/// What of a result must agree with its own list: ids from 1, by falling score, areas by vertex.
void expect_consistent(const Shape& s, const Pockets& found) {
    const Array<double> areas = vertex_areas(s.mesh);
    std::vector<double> area(found.list.size() + 1, 0);
    std::vector<std::uint64_t> count(found.list.size() + 1, 0);
    for (std::size_t v = 0; v < found.id.size(); ++v) {
        ASSERT_LE(found.id[v], found.list.size());
        area[found.id[v]] += areas[v];
        ++count[found.id[v]];
    }
    for (std::size_t i = 0; i < found.list.size(); ++i) {
        const Pocket& p = found.list[i];
        EXPECT_EQ(p.id, i + 1);
        EXPECT_EQ(p.vertices, count[i + 1]);
        EXPECT_NEAR(p.area_A2, area[i + 1], 1e-9 * p.area_A2);
        EXPECT_EQ(found.id[p.extreme_vertex], p.id);
        EXPECT_LE(p.mean_depth_A, p.depth_A + 1e-9);
        EXPECT_TRUE(p.opening.norm() == 0 || std::abs(p.opening.norm() - 1) < 1e-9);
        if (i > 0) {
            EXPECT_LE(p.score, found.list[i - 1].score);
        }
    }
}

}  // namespace

TEST(Pockets, NoneOnConvexAndOnFlatSurfaces) {
    Shape sphere;
    sphere.mesh = icosphere(4, 30);
    sphere.curvature = curvature_of(sphere.mesh, [](const Vec3d&) { return std::pair(1 / 30.0, 1 / 30.0); });
    // Needs no depth, so no CGAL either.
    const Pockets none = find_pockets(sphere.mesh, sphere.curvature);
    EXPECT_TRUE(none.list.empty());
    EXPECT_EQ(std::count(none.id.begin(), none.id.end(), 0u), std::ptrdiff_t(sphere.mesh.points.size()));
    EXPECT_NEAR(none.threshold, -0.5 / 30, 1e-6);
    EXPECT_NEAR(none.k1_below, 1 / 30.0, 1e-6);
    EXPECT_NEAR(none.area_A2, 4 * M_PI * 900, 20);
    const Shape flat = sheet(20, [](double, double) { return 0.0; });
    EXPECT_TRUE(find_pockets(flat.mesh, flat.curvature).list.empty());
    EXPECT_TRUE(find_pockets(TriMesh{}, Curvatures{}).list.empty());
}

TEST(Pockets, OfADentedSphereAreItsDents) {
    const Shape s = dented();
    const Pockets found = pockets(s);
    ASSERT_EQ(found.list.size(), dent_directions.size());
    expect_consistent(s, found);
    std::set<std::size_t> seen;
    for (const Pocket& p : found.list) {
        const auto nearest = std::max_element(
            dent_directions.begin(), dent_directions.end(),
            [&](const Vec3d& a, const Vec3d& b) { return a.dot(p.centroid) < b.dot(p.centroid); });
        seen.insert(std::size_t(nearest - dent_directions.begin()));
        EXPECT_LT((p.centroid.normalized() - *nearest).norm(), 0.01);
        EXPECT_GT(p.opening.dot(*nearest), 0.999);
        EXPECT_EQ(p.rims, 1u);
        EXPECT_FALSE(p.touches_border);
        EXPECT_LT(p.mean_k2, found.threshold);
        EXPECT_LE(p.extreme_k, p.mean_k2);
        EXPECT_NEAR(p.mean_H, 0.5 * (p.mean_k1 + p.mean_k2), 1e-12);
        EXPECT_NEAR(p.mouth_length_A * p.mouth_length_A / p.mouth_area_A2, 4 * M_PI, 0.4) << "about a circle";
    }
    EXPECT_EQ(seen.size(), dent_directions.size());
    // The deepest dent is the largest too.
    EXPECT_GT(found.list[0].centroid.normalized().dot(dent_directions[0]), 0.999);
    for (std::size_t i = 1; i < found.list.size(); ++i)
        EXPECT_GT(found.list[i].centroid.normalized().dot(dent_directions[i]), 0.999) << i;
}

TEST(Pockets, DepthsAndAreasAgreeWithBruteForce) {
    if (!have_convex_hull()) GTEST_SKIP() << "this build has no CGAL";
    const Shape s = dented(4);
    const Pockets found = pockets(s, below(-0.02));
    ASSERT_FALSE(found.list.empty());
    const TriMesh hull = convex_hull(s.mesh.points);
    std::vector<double> deepest(found.list.size() + 1, 0);
    for (std::size_t v = 0; v < s.mesh.points.size(); ++v) {
        double depth = infinity;  // a place in a convex body is as deep as the nearest plane
        for (const Triangle& t : hull.triangles) {
            const Vec3d a = hull.points[t[0]].cast<double>();
            const Vec3d n = (hull.points[t[1]].cast<double>() - a)
                                .cross(hull.points[t[2]].cast<double>() - a)
                                .normalized();
            depth = std::min(depth, n.dot(a - s.mesh.points[v].cast<double>()));
        }
        deepest[found.id[v]] = std::max(deepest[found.id[v]], depth);
    }
    for (const Pocket& p : found.list) EXPECT_NEAR(p.depth_A, deepest[p.id], 1e-5);
}

TEST(Pockets, ProtrusionsAreTheSameUpsideDown) {
    const Shape s = dented(5, -1);
    PocketOptions o;
    o.kind = PatchKind::protrusion;
    const Pockets found = pockets(s, o);
    ASSERT_EQ(found.list.size(), dent_directions.size());
    expect_consistent(s, found);
    for (std::size_t i = 0; i < found.list.size(); ++i) {
        const Pocket& p = found.list[i];
        EXPECT_GT(p.mean_k1, found.threshold);
        EXPECT_GE(p.extreme_k, p.mean_k1);
        EXPECT_GT(p.opening.dot(dent_directions[i]), 0.999);
        EXPECT_NEAR(p.score, (p.mean_k1 - found.threshold) * p.area_A2, 1e-9 * p.area_A2);
    }
    EXPECT_EQ(found.k1_below, infinity);
}

TEST(Pockets, TheHoleOfATorusIsAChannel) {
    const double ring = 25, tube = 10;
    const Shape s = torus(ring, tube, 200, 100);
    // k2 = cos v / (ring + tube cos v) under −0.04: cos v under −1/1.4.
    const double cosine = -1 / 1.4, v = std::acos(cosine), half = M_PI - v;
    const Pockets found = pockets(s, below(-0.04));
    ASSERT_EQ(found.list.size(), 1u);
    expect_consistent(s, found);
    const Pocket& p = found.list[0];
    const double area = 2 * M_PI * tube * (ring * 2 * half - tube * 2 * std::sin(half));
    EXPECT_NEAR(p.area_A2, area, 0.03 * area);
    EXPECT_EQ(p.rims, 2u);
    const double rim = ring + tube * cosine;
    EXPECT_NEAR(p.mouth_length_A, 2 * 2 * M_PI * rim, 0.01 * 2 * 2 * M_PI * rim);
    EXPECT_NEAR(p.mouth_area_A2, M_PI * rim * rim, 0.01 * M_PI * rim * rim);
    EXPECT_GT(std::abs(p.opening.z()), 0.9999);
    EXPECT_LT(p.centroid.norm(), 1e-3);
    EXPECT_NEAR(p.extreme_k, -1 / (ring - tube), 1e-4);
    // The hull closes the hole with flat lids at ± tube.
    if (have_convex_hull()) {
        EXPECT_NEAR(p.depth_A, tube, 0.01);
        EXPECT_LT(p.mean_depth_A, tube);
    }
    // The default takes k2 alone for no pocket, where k1 is as large.
    EXPECT_TRUE(pockets(s).list.empty());
}

TEST(Pockets, DepthUnderARollingBall) {
    const double ring = 25, tube = 10;
    const Shape s = torus(ring, tube);
    PocketOptions o = below(-0.04);
    // A ball of 20 lies on the hole: its centre at height h on the axis, h² + ring² = (tube + 20)².
    o.ambient_radius = 20;
    const double h = std::sqrt(30.0 * 30 - ring * ring);
    const double depth = std::hypot(h, ring - tube) - 20;
    const Pockets found = find_pockets(s.mesh, s.curvature, o);
    ASSERT_EQ(found.list.size(), 1u);
    EXPECT_GE(found.list[0].depth_A, depth - 0.01);
    EXPECT_LE(found.list[0].depth_A, depth + 0.5 * ambient_spacing * 20);
    // A ball of 10 goes through and touches all.
    o.ambient_radius = 10;
    EXPECT_LT(find_pockets(s.mesh, s.curvature, o).list[0].depth_A, 0.02 * 10);
}

TEST(Pockets, AmbientDepthAgreesWithBruteForce) {
    const Shape s = dented(4);
    const double radius = 60;
    std::vector<VertexId> some;
    for (VertexId v = 0; v < s.mesh.points.size(); v += 37) some.push_back(v);
    const std::vector<double> depths = ambient_depths(s.mesh, some, radius);
    // Centres of balls that touch the mesh and hold no vertex (to the mesh's own coarseness): star-shaped, so
    // all are got at. Found along rays.
    const TriMesh rays = icosphere(5, 1);
    std::vector<Vec3d> centres;
    for (const Vec3f& ray : rays.points) {
        const Vec3d d = ray.cast<double>();
        double reach = 0;  // the furthest out that the ball meets a vertex
        for (const Vec3f& point : s.mesh.points) {
            const Vec3d p = point.cast<double>();
            const double along = d.dot(p), off2 = p.squaredNorm() - along * along;
            if (off2 < radius * radius) reach = std::max(reach, along + std::sqrt(radius * radius - off2));
        }
        centres.push_back(reach * d);
    }
    double deepest = 0, sum = 0;
    for (std::size_t i = 0; i < some.size(); ++i) {
        double nearest = infinity;
        for (const Vec3d& c : centres)
            nearest = std::min(nearest, (c - s.mesh.points[some[i]].cast<double>()).norm());
        const double depth = std::max(0.0, nearest - radius);
        EXPECT_GT(depths[i], depth - 0.1) << some[i];
        EXPECT_LT(depths[i], depth + 0.01 * radius) << some[i];
        deepest = std::max(deepest, depth);
        sum += depths[i] - depth;
    }
    EXPECT_GT(deepest, 1);
    EXPECT_LT(std::abs(sum) / double(some.size()), 0.01 * radius);
}

TEST(Pockets, ACavityIsOnePocketWithoutAMouth) {
    const double inner = 20, outer = 40;
    Shape s;
    s.mesh = joined(icosphere(4, outer), flipped(icosphere(4, inner)));
    s.curvature = curvature_of(s.mesh, [&](const Vec3d& p) {
        const double k = p.norm() > 30 ? 1 / outer : -1 / inner;
        return std::pair(k, k);
    });
    for (const bool ball : {false, true}) {
        if (!ball && !have_convex_hull()) continue;
        PocketOptions o;
        if (ball) o.ambient_radius = 15;
        const Pockets found = find_pockets(s.mesh, s.curvature, o);
        ASSERT_EQ(found.list.size(), 1u);
        const Pocket& p = found.list[0];
        EXPECT_EQ(p.rims, 0u);
        EXPECT_EQ(p.mouth_area_A2, 0);
        EXPECT_EQ(p.opening, Vec3d(Vec3d::Zero()));
        EXPECT_NEAR(p.area_A2, 4 * M_PI * inner * inner, 0.01 * p.area_A2);
        EXPECT_NEAR(p.depth_A, outer - inner, 0.2);
        EXPECT_NEAR(p.mean_depth_A, outer - inner, 0.2);
    }
}

TEST(Pockets, PersistenceJoinsAndPartsTwoBowls) {
    // Wells of −1 and −0.8 at x = ±½ with a saddle of about −0.5 between them.
    const auto wells = [](double x, double y) {
        const auto well = [&](double at) { return std::exp(-((x - at) * (x - at) + y * y) / 0.18); };
        return -(0.95 * well(-0.5) + 0.75 * well(0.5));
    };
    const Shape s = sheet(60, wells);
    double shallow = 0, saddle = -10;
    for (int i = 0; i <= 60; ++i) {
        const double x = 2.0 * i / 60 - 1;
        if (x > 0) shallow = std::min(shallow, wells(x, 0));
        if (std::abs(x) < 0.3) saddle = std::max(saddle, wells(x, 0));
    }
    const double persistence = saddle - shallow;
    ASSERT_GT(persistence, 0.2);
    EXPECT_EQ(pockets(s, below(-0.2, 0, persistence + 0.001)).list.size(), 1u);
    const Pockets two = pockets(s, below(-0.2, 0, persistence - 0.001));
    ASSERT_EQ(two.list.size(), 2u);
    expect_consistent(s, two);
    std::set<int> sides;
    for (const Pocket& p : two.list) sides.insert(p.centroid.x() < 0 ? -1 : 1);
    EXPECT_EQ(sides.size(), 2u);
    // Above the saddle they are two whatever the persistence.
    EXPECT_EQ(pockets(s, below(saddle - 0.01)).list.size(), 2u);
    // By area: the smaller one goes.
    const double smaller = std::min(two.list[0].area_A2, two.list[1].area_A2);
    EXPECT_EQ(pockets(s, below(-0.2, smaller * 1.001, persistence - 0.001)).list.size(), 1u);
    EXPECT_EQ(pockets(s, below(-0.2, smaller, persistence - 0.001)).list.size(), 2u);
}

TEST(Pockets, RimIsTheLineOfTheThreshold) {
    const Shape s = sheet(
        80, [](double x, double y) { return std::hypot(x - 0.1, y) - 1.6; }, 10);
    // In units of the sheet of 10 Å: k2 under 4.4 − 1.6 … a disc of radius 4.4 about (0.1, 0).
    const Pockets found = pockets(s, below(4.4 - 1.6));
    ASSERT_EQ(found.list.size(), 1u);
    const Pocket& p = found.list[0];
    EXPECT_NEAR(p.mouth_length_A, 2 * M_PI * 4.4, 0.005 * p.mouth_length_A);
    EXPECT_NEAR(p.mouth_area_A2, M_PI * 4.4 * 4.4, 0.003 * p.mouth_area_A2);
    EXPECT_NEAR(p.opening.z(), 1, 1e-9);
    EXPECT_NEAR(p.centroid.x(), 0.1, 0.02);
    EXPECT_EQ(p.depth_A, 0);  // all in one plane
}

TEST(Pockets, PinholesAreNoMouths) {
    // A disc of radius 6 with a hole of radius 1.2, whose area is a 25th, and one of 2, whose is a ninth.
    for (const double hole : {1.2, 2.0}) {
        const Shape s = sheet(
            80,
            [&](double x, double y) { return std::max(std::hypot(x, y) - 6, hole - std::hypot(x - 2, y)); },
            10);
        const Pockets found = pockets(s, below(0));
        ASSERT_EQ(found.list.size(), 1u);
        EXPECT_EQ(found.list[0].rims, hole < 1.5 ? 1u : 2u);
        const double length = 2 * M_PI * (hole < 1.5 ? 6 : 6 + hole);
        EXPECT_NEAR(found.list[0].mouth_length_A, length, 0.01 * length);
        EXPECT_NEAR(found.list[0].mouth_area_A2, 36 * M_PI, 0.01 * 36 * M_PI);
    }
}

TEST(Pockets, BordersAndCapsAreLeftOut) {
    Shape s;
    s.mesh = flipped(open_cylinder_mesh(10, 40, 24, 96));
    s.curvature = curvature_of(s.mesh, [](const Vec3d&) { return std::pair(0.0, -0.1); });
    const Pockets open = pockets(s, below(-0.05));
    ASSERT_EQ(open.list.size(), 1u);
    EXPECT_TRUE(open.list[0].touches_border);
    EXPECT_EQ(open.list[0].rims, 2u);
    EXPECT_EQ(open.list[0].vertices, 23u * 96u);
    for (std::size_t v = 0; v < s.mesh.points.size(); ++v)
        EXPECT_EQ(open.id[v], std::abs(s.mesh.points[v].z()) > 19.9f ? 0u : 1u);
    // Closed with lids that are caps it is the same.
    Shape capped = s;
    for (const int row : {0, 24}) {
        const VertexId centre = VertexId(capped.mesh.points.size());
        capped.mesh.points.emplace_back(0.f, 0.f, row ? 20.f : -20.f);
        for (int c = 0; c < 96; ++c) {
            const VertexId a = VertexId(row * 96 + c), b = VertexId(row * 96 + (c + 1) % 96);
            capped.mesh.triangles.push_back(row ? Triangle{centre, b, a} : Triangle{centre, a, b});
        }
    }
    std::vector<float> caps(capped.mesh.triangles.size(), 0);
    std::fill(caps.begin() + std::ptrdiff_t(s.mesh.triangles.size()), caps.end(), 1.f);
    capped.mesh.face_properties.push_back({cap_property, 1, caps});
    capped.curvature = curvature_of(capped.mesh, [](const Vec3d&) { return std::pair(0.0, -0.1); });
    const Pockets closed = pockets(capped, below(-0.05));
    ASSERT_EQ(closed.list.size(), 1u);
    EXPECT_EQ(closed.list[0].vertices, open.list[0].vertices);
    EXPECT_TRUE(closed.list[0].touches_border);
    EXPECT_NEAR(closed.area_A2, open.area_A2, 1e-6 * open.area_A2);
}

TEST(Pockets, TenThousandPieces) {
    Shape s;
    const TriMesh one = cube();
    for (int i = 0; i < 10000; ++i) {
        const VertexId first = VertexId(s.mesh.points.size());
        for (const Vec3f& p : one.points)
            s.mesh.points.push_back(p + 2 * Vec3f(float(i % 100), float(i / 100), 0));
        for (const Triangle& t : one.triangles)
            s.mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
    s.curvature = curvature_of(s.mesh, [](const Vec3d&) { return std::pair(-1.0, -1.0); });
    PocketOptions o = below(-0.5);
    const Pockets found = pockets(s, o);
    ASSERT_EQ(found.list.size(), 10000u);
    expect_consistent(s, found);
    for (const Pocket& p : found.list) EXPECT_NEAR(p.area_A2, 6, 1e-5);
    o.ambient_radius = 6;
    EXPECT_EQ(find_pockets(s.mesh, s.curvature, o).list.size(), 10000u);
}

TEST(Pockets, FarFromTheOrigin) {
    Shape s = dented(4);
    const Pockets near = pockets(s, below(-0.02));
    const Vec3d shift(65536, -65536, 65536);
    for (Vec3f& p : s.mesh.points) p += shift.cast<float>();
    const Pockets far = pockets(s, below(-0.02));
    ASSERT_EQ(near.list.size(), far.list.size());
    for (std::size_t i = 0; i < near.list.size(); ++i) {
        EXPECT_EQ(near.list[i].vertices, far.list[i].vertices);
        EXPECT_LT((far.list[i].centroid - shift - near.list[i].centroid).norm(), 0.01);
        EXPECT_NEAR(far.list[i].depth_A, near.list[i].depth_A, 0.02);
        EXPECT_NEAR(far.list[i].mouth_area_A2, near.list[i].mouth_area_A2, 0.01 * near.list[i].mouth_area_A2);
    }
}

TEST(Pockets, SameBytesForAnyThreads) {
    const Shape s = dented();
    PocketOptions o = below(-0.01, 0, 0);
    o.ambient_radius = 25;
    const auto run = [&](int threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        const Pockets found = find_pockets(s.mesh, s.curvature, o);
        std::vector<double> numbers;
        for (const Pocket& p : found.list)
            for (const double x : {p.area_A2, p.centroid.x(), p.mean_k1, p.mean_K, p.depth_A, p.mean_depth_A,
                                   p.mouth_length_A, p.mouth_area_A2, p.opening.y(), p.score})
                numbers.push_back(x);
        return std::pair(numbers, found.id);
    };
    const auto one = run(1), four = run(4);
    ASSERT_GE(one.first.size(), 50u);
    EXPECT_EQ(one.second, four.second);
    ASSERT_EQ(one.first.size(), four.first.size());
    EXPECT_EQ(std::memcmp(one.first.data(), four.first.data(), one.first.size() * sizeof(double)), 0);
}

TEST(Pockets, RefusesBadOptionsAndSizes) {
    const auto refuse = [](const PocketOptions& o, const std::string& text) {
        try {
            o.check();
            ADD_FAILURE() << text;
        } catch (const InvalidInput& e) {
            EXPECT_NE(std::string(e.what()).find(text), std::string::npos) << e.what();
        }
    };
    PocketOptions o;
    o.k2_below = -infinity;
    refuse(o, "the bound on k2 is -inf");
    o = {};
    o.k1_below = std::nan("");
    refuse(o, "the bound on k1 is nan");
    o = {};
    o.min_area = -1;
    refuse(o, "the least area is -1");
    o = {};
    o.min_persistence = -0.1;
    refuse(o, "the least persistence is -0.1");
    o = {};
    o.ambient_radius = 0;
    refuse(o, "the ball's radius is 0");
    o = {};
    o.k1_above = 1;
    refuse(o, "one of protrusions");
    o = {};
    o.kind = PatchKind::protrusion;
    o.k1_below = 1;
    refuse(o, "those of pockets");
    const Shape s = torus(25, 10, 20, 10);
    EXPECT_THROW(find_pockets(tetrahedron(), s.curvature), InvalidInput);
    PocketOptions tiny = below(-0.01);
    tiny.ambient_radius = 0.01;
    EXPECT_THROW(find_pockets(s.mesh, s.curvature, tiny), InvalidInput);
    EXPECT_THROW(find_pockets(s.mesh, s.curvature, {}, Progress([](double) { return false; })), Cancelled);
}

// Twins by definition, on random numbers.
class Basins : public testing::TestWithParam<unsigned> {
 protected:
    TriMesh mesh_ = torus_mesh(25, 10, 24, 16);
    std::vector<VertexId> vertices_;
    std::vector<double> values_, of_vertex_;

    void SetUp() override {
        std::mt19937 random(GetParam());
        of_vertex_.assign(mesh_.points.size(), infinity);
        for (VertexId v = 0; v < mesh_.points.size(); ++v) {
            const double value = std::uniform_real_distribution<>(-1, 1)(random);
            if (value > 0.1) continue;
            vertices_.push_back(v);
            values_.push_back(value);
            of_vertex_[v] = value;
        }
    }
    /// All that can be reached from v over vertices under a level.
    std::set<VertexId> flooded(VertexId from, double level) const {
        const VertexNeighbours near(mesh_);
        std::set<VertexId> seen{from};
        std::vector<VertexId> front{from};
        while (!front.empty()) {
            const VertexId v = front.back();
            front.pop_back();
            for (auto n = near.begin[v]; n < near.begin[v + 1]; ++n)
                if (of_vertex_[near.neighbours[n]] <= level && seen.insert(near.neighbours[n]).second)
                    front.push_back(near.neighbours[n]);
        }
        return seen;
    }
};

TEST_P(Basins, WithoutPersistenceAreWhatFloodFillFinds) {
    const auto basins = sublevel_basins(mesh_, vertices_, values_, infinity);
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
        const std::set<VertexId> piece = flooded(vertices_[i], 0.1);
        if (vertices_[i] == *piece.begin()) {
            EXPECT_EQ(basins[i], next++);
        }
        const auto first = std::lower_bound(vertices_.begin(), vertices_.end(), *piece.begin());
        EXPECT_EQ(basins[i], basins[std::size_t(first - vertices_.begin())]);
    }
}

TEST_P(Basins, AreAsManyAsPersistentMinima) {
    for (const double least : {0.0, 0.1, 0.3, 0.6}) {
        const auto basins = sublevel_basins(mesh_, vertices_, values_, least);
        // A minimum's persistence: how far one has to climb from it to get to a lower one.
        std::set<VertexId> persistent;
        for (std::size_t i = 0; i < vertices_.size(); ++i) {
            const VertexId v = vertices_[i];
            if (flooded(v, values_[i]).size() > 1) continue;  // no minimum
            double persistence = infinity;
            for (const double level : values_) {
                if (level < values_[i] || level - values_[i] >= persistence) continue;
                for (const VertexId w : flooded(v, level))
                    if (of_vertex_[w] < values_[i]) persistence = level - values_[i];
            }
            if (persistence >= least) persistent.insert(v);
        }
        std::set<std::uint32_t> found(basins.begin(), basins.end());
        EXPECT_EQ(found.size(), persistent.size()) << least;
        // Each basin has one of them, its lowest place, and hangs together.
        for (const std::uint32_t b : found) {
            std::set<VertexId> members;
            VertexId lowest = 0;
            double low = infinity;
            for (std::size_t i = 0; i < vertices_.size(); ++i)
                if (basins[i] == b) {
                    members.insert(vertices_[i]);
                    if (values_[i] < low) low = values_[i], lowest = vertices_[i];
                }
            EXPECT_TRUE(persistent.count(lowest));
            const VertexNeighbours near(mesh_);
            std::vector<VertexId> front{lowest};
            members.erase(lowest);
            while (!front.empty()) {
                const VertexId v = front.back();
                front.pop_back();
                for (auto n = near.begin[v]; n < near.begin[v + 1]; ++n)
                    if (members.erase(near.neighbours[n])) front.push_back(near.neighbours[n]);
            }
            EXPECT_TRUE(members.empty());
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Random, Basins, testing::Values(1u, 2u, 3u));
