#include "vdbgeo/measure/curvature_tensor.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <queue>
#include <random>
#include <set>

#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/face_bends.h"
#include "vdbgeo/measure/geodesic_disc.h"
#include "vdbgeo/measure/mesh_measures.h"

namespace vdbgeo {
namespace {

constexpr TensorNeighbourhood kinds[] = {TensorNeighbourhood::ring, TensorNeighbourhood::ball,
                                         TensorNeighbourhood::geodesic};

CurvatureTensorOptions ball(double radius) { return {TensorNeighbourhood::ball, radius}; }

Vec3d at(const TriMesh& mesh, VertexId v) { return mesh.points[v].cast<double>(); }

/// A square of n × n cells in the plane z = 0, in triangles of one shape.
TriMesh flat_square(int n) {
    TriMesh mesh;
    const auto id = [&](int x, int y) { return VertexId(y * (n + 1) + x); };
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x) mesh.points.emplace_back(float(x), float(y), 0.f);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            mesh.triangles.push_back({id(x, y), id(x + 1, y), id(x + 1, y + 1)});
            mesh.triangles.push_back({id(x, y), id(x + 1, y + 1), id(x, y + 1)});
        }
    return mesh;
}

/// Eq 16 over a ball by brute force: every face and edge cut into small pieces, each in or out by its middle;
/// joined to the vertex by sides with a piece within the ball.
struct BallTwin {
    Mat3d tensor = Mat3d::Zero();
    double area = 0;

    BallTwin(const TriMesh& mesh, VertexId centre, double radius) {
        const Vec3d c = at(mesh, centre);
        std::map<std::pair<VertexId, VertexId>, std::vector<std::size_t>> edges;
        for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
            for (std::size_t k = 0; k < 3; ++k)
                edges[std::minmax(mesh.triangles[f][k], mesh.triangles[f][(k + 1) % 3])].push_back(f);
        const auto share = [&](const Vec3d& a, const Vec3d& b) {
            constexpr int pieces = 20000;
            int in = 0;
            for (int i = 0; i < pieces; ++i) in += (a + (b - a) * ((i + 0.5) / pieces) - c).norm() <= radius;
            return double(in) / pieces;
        };
        std::set<std::size_t> found;
        std::queue<std::size_t> front;
        for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
            for (const VertexId v : mesh.triangles[f])
                if (v == centre && found.insert(f).second) front.push(f);
        for (; !front.empty(); front.pop()) {
            const Triangle& t = mesh.triangles[front.front()];
            add_area(at(mesh, t[0]), at(mesh, t[1]), at(mesh, t[2]), c, radius, 6);
            for (std::size_t k = 0; k < 3; ++k) {
                const Vec3d a = at(mesh, t[k]), b = at(mesh, t[(k + 1) % 3]);
                const double in = share(a, b);
                const auto& faces = edges[std::minmax(t[k], t[(k + 1) % 3])];
                if (in == 0 || faces.size() != 2) continue;
                const Vec3d e = (b - a).normalized();
                tensor +=
                    0.5 * bend(mesh, faces, b - a, front.front()) * in * (b - a).norm() * e * e.transpose();
                for (const std::size_t f : faces)
                    if (found.insert(f).second) front.push(f);
            }
        }
    }
    static Vec3d normal(const TriMesh& mesh, std::size_t f) {
        const Triangle& t = mesh.triangles[f];
        return (at(mesh, t[1]) - at(mesh, t[0])).cross(at(mesh, t[2]) - at(mesh, t[0])).normalized();
    }
    static double bend(const TriMesh& mesh, const std::vector<std::size_t>& faces, const Vec3d& side,
                       std::size_t of) {
        const Vec3d n = normal(mesh, of), m = normal(mesh, faces[0] == of ? faces[1] : faces[0]);
        return std::copysign(std::acos(std::clamp(n.dot(m), -1.0, 1.0)), n.cross(m).dot(side));
    }
    void add_area(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& centre, double radius,
                  int depth) {
        if (depth == 0) {
            if (((a + b + c) / 3 - centre).norm() <= radius) area += 0.5 * (b - a).cross(c - a).norm();
            return;
        }
        const Vec3d ab = (a + b) / 2, bc = (b + c) / 2, ca = (c + a) / 2;
        add_area(a, ab, ca, centre, radius, depth - 1);
        add_area(b, bc, ab, centre, radius, depth - 1);
        add_area(c, ca, bc, centre, radius, depth - 1);
        add_area(ab, bc, ca, centre, radius, depth - 1);
    }
};

TriMesh bumpy(TriMesh mesh, float by, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> push(-by, by);
    for (Vec3f& p : mesh.points) p += Vec3f(push(random), push(random), push(random));
    return mesh;
}

TEST(CurvatureTensor, BallIsEquation16CutExactly) {
    const TriMesh mesh = bumpy(test::torus_mesh(4, 1.5, 24, 12), 0.03f, 1);
    for (const double radius : {0.3, 0.9, 1.7}) {
        const Curvatures c = tensor_curvature(mesh, ball(radius));
        for (const VertexId v : {0u, 7u, 100u, 211u}) {
            const BallTwin twin(mesh, v, radius);
            const Vec3d d1 = c.direction1[v].cast<double>(), d2 = c.direction2[v].cast<double>();
            const Mat3d mean = twin.tensor / twin.area;
            // Across each direction lies the other's curvature.
            EXPECT_NEAR(d2.dot(mean * d2), c.k1[v], 0.01 * std::abs(c.k1[v]) + 1e-3) << v;
            EXPECT_NEAR(d1.dot(mean * d1), c.k2[v], 0.01 * std::abs(c.k1[v]) + 1e-3) << v;
            EXPECT_NEAR(d1.dot(mean * d2), 0, 0.01 * std::abs(c.k1[v])) << v;
        }
    }
}

TEST(CurvatureTensor, CylinderBendsAcrossItsAxis) {
    const TriMesh mesh = test::open_cylinder_mesh(5, 20, 60, 96);
    for (const TensorNeighbourhood kind : kinds)
        for (const bool inward : {false, true}) {
            const Curvatures c = tensor_curvature(inward ? test::flipped(mesh) : mesh, {kind, {}});
            for (VertexId v = 0; v < c.size(); ++v) {
                const Vec3d p = at(mesh, v);
                if (std::abs(p.z()) > 8) continue;
                const Vec3d round = Vec3d(-p.y(), p.x(), 0).normalized();
                const auto& bent = inward ? c.direction2[v] : c.direction1[v];
                const auto& straight = inward ? c.direction1[v] : c.direction2[v];
                ASSERT_NEAR(inward ? -c.k2[v] : c.k1[v], 0.2, 0.02) << int(kind);
                ASSERT_NEAR(inward ? c.k1[v] : c.k2[v], 0, 0.01) << int(kind);
                ASSERT_GT(std::abs(bent.cast<double>().dot(round)), 0.999);
                ASSERT_GT(std::abs(straight.cast<double>().z()), 0.999);
                ASSERT_EQ(c.flags[v], 0);
            }
        }
}

TEST(CurvatureTensor, TorusValuesAndDirections) {
    const double ring = 25, tube = 10;
    const TriMesh mesh = test::torus_mesh(ring, tube, 160, 64);
    for (const TensorNeighbourhood kind : kinds) {
        const Curvatures c = tensor_curvature(mesh, {kind, {}});
        for (VertexId v = 0; v < c.size(); ++v) {
            const Vec3d p = at(mesh, v);
            const double out = std::hypot(p.x(), p.y()) - ring, cosine = out / tube;
            ASSERT_NEAR(c.k1[v], 1 / tube, 0.05 / tube) << int(kind);
            ASSERT_NEAR(c.k2[v], cosine / (ring + out), 0.05 / tube) << int(kind);
            ASSERT_NEAR(c.K[v], c.k1[v] * c.k2[v], 1e-15);
            ASSERT_NEAR(c.H[v], 0.5 * (c.k1[v] + c.k2[v]), 1e-15);
            const Vec3d along = Vec3d(-p.y(), p.x(), 0).normalized();
            const Vec3d normal = (Vec3d(p.x(), p.y(), 0) / (ring + out) * cosine + Vec3d(0, 0, p.z() / tube));
            const Vec3d d1 = c.direction1[v].cast<double>(), d2 = c.direction2[v].cast<double>();
            ASSERT_LT(std::abs(d1.dot(along)), 0.02) << int(kind);
            ASSERT_GT(std::abs(d2.dot(along)), 0.999);
            ASSERT_LT(std::abs(d1.dot(normal)), 0.02);
            ASSERT_LT(std::abs(d1.dot(d2)), 1e-6);
            ASSERT_NEAR(d1.norm(), 1, 1e-6);
            ASSERT_GT(d1.maxCoeff(), -d1.minCoeff() - 1e-6);  // the largest component is positive
        }
    }
}

/// Root of the mean square error of r H over a sphere for balls of a fixed radius.
double sphere_error(int subdivisions) {
    const TriMesh mesh = test::icosphere(subdivisions, 10);
    const Curvatures c = tensor_curvature(mesh, ball(2.5));
    double sum = 0;
    for (const double H : c.H) sum += std::pow(10 * H - 1, 2);
    return std::sqrt(sum / double(c.size()));
}

TEST(CurvatureTensor, ConvergesOnTheSphere) {
    const double coarse = sphere_error(3), middle = sphere_error(4), fine = sphere_error(5);
    EXPECT_LT(middle, 0.7 * coarse);
    EXPECT_LT(fine, 0.7 * middle);
    EXPECT_LT(fine, 0.015);
}

TEST(CurvatureTensor, PlanesAreFlatAndKeepTheirDirections) {
    TriMesh mesh = flat_square(12);
    for (const TensorNeighbourhood kind : kinds) {
        const Curvatures c = tensor_curvature(mesh, {kind, {}});
        for (VertexId v = 0; v < c.size(); ++v) {
            EXPECT_EQ(c.k1[v], 0);
            EXPECT_EQ(c.k2[v], 0);
            EXPECT_EQ(c.direction1[v].z(), 0);
            EXPECT_NEAR(c.direction1[v].norm(), 1, 1e-6);
            const auto [x, y] = std::pair(v % 13, v / 13);
            EXPECT_EQ(c.flags[v], x == 0 || y == 0 || x == 12 || y == 12 ? curvature_border : 0);
        }
    }
}

TEST(CurvatureTensor, AnotherSheetNearbyIsNotSeen) {
    TriMesh one = test::icosphere(3, 10), two = one;
    for (Vec3f& p : two.points) p.z() += 20.5f;
    const TriMesh both = test::joined(one, two);
    for (const auto& options : {ball(4), CurvatureTensorOptions{TensorNeighbourhood::geodesic, 4.0}}) {
        const Curvatures alone = tensor_curvature(one, options), beside = tensor_curvature(both, options);
        for (std::size_t v = 0; v < one.points.size(); ++v) EXPECT_EQ(alone.k1[v], beside.k1[v]);
    }
}

TEST(CurvatureTensor, AFaceWithoutAreaHidesNoBend) {
    // A roof whose ridge has a vertex that only one of its slopes knows: the face between has no area.
    TriMesh mesh = test::mesh_of({{0, 0, 1}, {2, 0, 1}, {1, 2, 0}, {1, -2, 0}, {1, 0, 1}},
                                 {{0, 1, 2}, {0, 3, 4}, {4, 3, 1}, {0, 4, 1}});
    const VertexFaces faces(mesh);
    const FaceBends bends(mesh, faces);
    const double slope = 2 * std::atan(0.5);
    EXPECT_NEAR(bends.angle[0], 0, 1e-6);          // 0 1: between the slope and the flat face
    EXPECT_NEAR(bends.angle[3 + 2], slope, 1e-6);  // 4 0
    EXPECT_NEAR(bends.angle[6 + 2], slope, 1e-6);  // 1 4
}

TEST(CurvatureTensor, BendsAreSignedAndOnBothSides) {
    const TriMesh cube = test::cube();
    const FaceBends bends(cube, VertexFaces(cube));
    for (std::size_t s = 0; s < bends.angle.size(); ++s) {
        const double angle = bends.angle[s];
        EXPECT_TRUE(std::abs(angle) < 1e-7 || std::abs(angle - M_PI / 2) < 1e-6) << angle;
        EXPECT_NE(bends.across[s], FaceBends::none);
    }
    const TriMesh inside = test::flipped(cube);
    const FaceBends other(inside, VertexFaces(inside));
    EXPECT_LT(*std::min_element(other.angle.begin(), other.angle.end()), -1.5f);
    const TriMesh three = test::two_cubes_sharing_an_edge();
    const FaceBends none(three, VertexFaces(three));
    EXPECT_EQ(std::count(none.across.begin(), none.across.end(), FaceBends::none), 4);
}

TEST(CurvatureTensor, GeodesicDistancesAreStraightOnAPlane) {
    const TriMesh mesh = bumpy(flat_square(20), 0.2f, 3);
    TriMesh flat = mesh;
    for (Vec3f& p : flat.points) p.z() = 0;
    const VertexFaces faces(flat);
    GeodesicDisc disc(flat, faces);
    const VertexId centre = 10 * 21 + 10;
    const auto members = disc.find(centre, 8);
    double before = 0, worst = 0, sum = 0;
    for (const auto& [v, distance] : members) {
        EXPECT_GE(distance, before);
        before = distance;
        const double straight = (at(flat, v) - at(flat, centre)).norm();
        EXPECT_GE(distance, straight * (1 - 1e-12));
        if (straight == 0) continue;
        worst = std::max(worst, distance / straight - 1);
        sum += distance / straight - 1;
    }
    EXPECT_LT(worst, 0.05);  // some faces are obtuse
    EXPECT_LT(sum / double(members.size()), 0.003);
    EXPECT_GT(members.size(), 190u);  // of 64 π
}

TEST(CurvatureTensor, GeodesicDistancesOnASphere) {
    const TriMesh mesh = test::icosphere(5, 10);
    const VertexFaces faces(mesh);
    GeodesicDisc disc(mesh, faces);
    for (const auto& [v, distance] : disc.find(0, 10)) {
        const double angle = 2 * std::asin((at(mesh, 0) - at(mesh, v)).norm() / 20);
        EXPECT_NEAR(distance, 10 * angle, 0.003 * distance);
    }
    EXPECT_EQ(disc.find(17, 0).size(), 1u);
}

TEST(CurvatureTensor, CapsAndBordersAreOneSided) {
    TriMesh mesh = test::open_cylinder_mesh(5, 10, 30, 96);
    const std::size_t faces = mesh.triangles.size();
    const VertexId middle = VertexId(mesh.points.size());
    mesh.points.emplace_back(0.f, 0.f, 5.f);
    for (VertexId i = 0; i < 96; ++i) mesh.triangles.push_back({30 * 96 + i, 30 * 96 + (i + 1) % 96, middle});
    mesh.face_properties.push_back({cap_property, 1, std::vector<float>(mesh.triangles.size(), 0.f)});
    std::fill(mesh.face_properties[0].values.begin() + std::ptrdiff_t(faces),
              mesh.face_properties[0].values.end(), 1.f);
    for (const TensorNeighbourhood kind : kinds) {
        const Curvatures c = tensor_curvature(mesh, {kind, {}});
        EXPECT_EQ(c.flags[middle], curvature_cap | curvature_undefined);
        EXPECT_TRUE(std::isnan(c.k1[middle]));
        EXPECT_EQ(c.direction1[middle], Vec3f(Vec3f::Zero()));
        for (VertexId v = 30 * 96; v < middle; ++v) {
            EXPECT_EQ(c.flags[v], curvature_border);
            EXPECT_NEAR(c.k1[v], 0.2, 0.05) << int(kind);
            EXPECT_NEAR(c.k2[v], 0, 0.02);
        }
    }
}

TEST(CurvatureTensor, SmallAndOddMeshes) {
    for (const TensorNeighbourhood kind : kinds) {
        EXPECT_EQ(tensor_curvature({}, {kind, {}}).size(), 0u);
        TriMesh mesh = test::icosphere(1, 1);
        mesh.points.emplace_back(3.f, 3.f, 3.f);
        const Curvatures c = tensor_curvature(mesh, {kind, {}});
        EXPECT_EQ(c.flags.back(), curvature_undefined);
        EXPECT_TRUE(std::isnan(c.k2[c.size() - 1]));
        const Curvatures pillow = tensor_curvature(
            test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}}), {kind, {}});
        for (std::size_t v = 0; v < 3; ++v) EXPECT_FALSE(pillow.defined(v));  // no mean normal
        EXPECT_THROW(tensor_curvature(test::moebius(12), {kind, {}}), InvalidInput);
    }
    for (const double radius : {0.0, -1.0, std::nan(""), HUGE_VAL})
        EXPECT_THROW(tensor_curvature(test::cube(), ball(radius)), InvalidInput);
}

TEST(CurvatureTensor, OfAPieceSmallerThanTheBall) {
    // The normals of all faces cancel; the vertex's own tell the tangent plane.
    const Curvatures c = tensor_curvature(test::cube(), ball(100));
    for (std::size_t v = 0; v < c.size(); ++v) {
        ASSERT_TRUE(c.defined(v)) << v;
        EXPECT_GT(c.H[v], 0);
        EXPECT_NEAR(c.H[v], c.H[0], 1e-12);
    }
}

TEST(CurvatureTensor, TheSameForAnyNumberOfThreads) {
    const TriMesh mesh = bumpy(test::torus_mesh(25, 10, 120, 60), 0.02f, 4);
    for (const TensorNeighbourhood kind : kinds) {
        const auto with_threads = [&](std::size_t threads) {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
            return tensor_curvature(mesh, {kind, {}});
        };
        const Curvatures one = with_threads(1), two = with_threads(2);
        EXPECT_EQ(one.k1, two.k1);
        EXPECT_EQ(one.k2, two.k2);
        EXPECT_EQ(one.direction1, two.direction1);
    }
}

}  // namespace
}  // namespace vdbgeo
