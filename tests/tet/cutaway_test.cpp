// What is left of a mesh when tetrahedra are taken away: closed, of the right volume, told apart by its
// faces.
#include "vdbgeo/tet/cutaway.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "tests/support/tet_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/tet/tet_quality.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

CutawayOptions by_plane(const Vec3d& point, const Vec3d& normal, bool whole) {
    CutawayOptions o;
    o.plane = CutawayOptions::Plane{point, normal, whole};
    return o;
}

CutawayOptions by_peel(std::uint64_t count, const Vec3d& from) {
    CutawayOptions o;
    o.peel = CutawayOptions::Peel{count, std::nullopt, from};
    return o;
}

double volume_of(const TetMesh& mesh, std::size_t t) { return tet_determinant(mesh, t) / 6; }

struct Enclosed {
    double volume = 0, interior_area = 0, area = 0;
    Vec3d closing = Vec3d::Zero();
};

Enclosed enclosed(const TriMesh& mesh) {
    Enclosed e;
    const auto& interior = mesh.find_face_property("interior")->values;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        const Vec3d normal = (b - a).cross(c - a) / 2;
        e.volume += a.dot(normal) / 3;
        e.closing += normal;
        e.area += normal.norm();
        if (interior[f] > 0) e.interior_area += normal.norm();
    }
    return e;
}

/// Whether each edge, by the places of its ends, is run through as often one way as the other.
bool closed_by_places(const TriMesh& mesh) {
    std::map<std::array<float, 3>, int> number;
    std::map<std::pair<int, int>, int> balance;
    const auto id = [&](VertexId v) {
        const Vec3f& p = mesh.points[v];
        return number.try_emplace({p.x(), p.y(), p.z()}, static_cast<int>(number.size())).first->second;
    };
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const int a = id(t[k]), b = id(t[(k + 1) % 3]);
            balance[std::minmax(a, b)] += a < b ? 1 : a > b ? -1 : 0;
        }
    return std::all_of(balance.begin(), balance.end(), [](const auto& e) { return e.second == 0; });
}

TetMesh shaken(TetMesh mesh, double by) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> shake(-by, by);
    move_points(
        mesh, [&](const Vec3d& p) { return Vec3d(p + Vec3d(shake(random), shake(random), shake(random))); });
    return mesh;
}

/// The part of a tetrahedron where a linear function with these values at the corners is negative, all four
/// different: Σ over the negative ones of s_i³ / Π (s_i − s_j).
double negative_part(const std::array<double, 4>& s) {
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        if (s[i] >= 0) continue;
        double product = 1;
        for (std::size_t j = 0; j < 4; ++j)
            if (j != i) product *= s[i] - s[j];
        sum += s[i] * s[i] * s[i] / product;
    }
    return sum;
}

/// The area of the section: where the edges cross the plane, sorted around their middle.
double section_area(const std::array<Vec3d, 4>& p, const std::array<double, 4>& s, const Vec3d& normal) {
    std::vector<Vec3d> points;
    for (const auto& [i, j] : tet_edges) {
        const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
        if ((s[a] < 0) != (s[b] < 0)) points.push_back(p[a] + s[a] / (s[a] - s[b]) * (p[b] - p[a]));
    }
    if (points.size() < 3) return 0;
    Vec3d middle = Vec3d::Zero();
    for (const Vec3d& q : points) middle += q / static_cast<double>(points.size());
    const Vec3d u = normal.unitOrthogonal(), v = normal.cross(u);
    std::sort(points.begin(), points.end(), [&](const Vec3d& a, const Vec3d& b) {
        return std::atan2((a - middle).dot(v), (a - middle).dot(u)) <
               std::atan2((b - middle).dot(v), (b - middle).dot(u));
    });
    double area = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
        area += (points[i] - middle).cross(points[(i + 1) % points.size()] - middle).dot(normal) / 2;
    return area;
}

/// The tetrahedra that a peel takes, by sets.
std::set<std::size_t> slow_peel(const TetMesh& mesh, std::size_t seed, std::size_t count) {
    std::map<std::array<VertexId, 3>, std::vector<std::size_t>> owners;
    const auto key = [&](std::size_t t, std::size_t k) {
        std::array<VertexId, 3> f{};
        for (std::size_t c = 0; c < 3; ++c) f[c] = mesh.tets[t][static_cast<std::size_t>(tet_faces[k][c])];
        std::sort(f.begin(), f.end());
        return f;
    };
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (std::size_t k = 0; k < 4; ++k) owners[key(t, k)].push_back(t);
    std::vector<std::size_t> order{seed};
    std::set<std::size_t> seen{seed};
    for (std::size_t at = 0; at < order.size(); ++at) {
        std::set<std::size_t> next;
        for (std::size_t k = 0; k < 4; ++k)
            for (const std::size_t n : owners[key(order[at], k)])
                if (!seen.count(n)) next.insert(n);
        for (const std::size_t n : next) {
            seen.insert(n);
            order.push_back(n);
        }
    }
    order.resize(std::min(order.size(), count));
    return {order.begin(), order.end()};
}

}  // namespace

TEST(Cutaway, WithNothingTakenAwayIsTheBoundary) {
    const TetMesh mesh = ball_tets(10, 2);
    const TriMesh whole = boundary_surface(mesh);
    for (const CutawayOptions& o : {by_peel(0, {0, 0, 0}), by_plane({0, 0, 11}, {0, 0, 1}, true),
                                    by_plane({0, 0, 11}, {0, 0, 1}, false)}) {
        const TriMesh out = cutaway(mesh, o);
        EXPECT_EQ(out.points, whole.points);
        EXPECT_EQ(out.triangles, whole.triangles);
        for (const float v : out.find_face_property("interior")->values) EXPECT_EQ(v, 0);
        for (const float v : out.find_vertex_property("min_dihedral_deg")->values) EXPECT_TRUE(std::isnan(v));
    }
}

TEST(Cutaway, WholeTetrahedraGoBeyondThePlane) {
    const TetMesh mesh = shaken(torus_tets(10, 4, 1), 0.1);
    for (const Vec3d& normal : {Vec3d(0, 1, 0), Vec3d(1, -2, 0.5), Vec3d(1e-200, 0, 1e-200)}) {
        const Vec3d point(0.3, 0.2, -0.4);
        double volume = 0;
        for (std::size_t t = 0; t < mesh.tets.size(); ++t)
            if ((centroid(mesh, t) - point).dot(normal.stableNormalized()) <= 0) volume += volume_of(mesh, t);
        const TriMesh out = cutaway(mesh, by_plane(point, normal, true));
        check(out, "cutaway");
        const Enclosed e = enclosed(out);
        EXPECT_NEAR(e.volume, volume, 1e-6 * volume);
        EXPECT_LT(e.closing.norm(), 1e-6 * e.area);
        EXPECT_GT(e.interior_area, 100);
        EXPECT_TRUE(closed_by_places(out));
    }
}

TEST(Cutaway, FlatCutsEncloseWhatIsLeft) {
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    for (const TetMesh& mesh : {shaken(ball_tets(10, 1.5), 0.1), shaken(torus_tets(9, 4, 1), 0.1)})
        for (int i = 0; i < 8; ++i) {
            const Vec3d n = Vec3d(normal(random), normal(random), normal(random)).normalized();
            const Vec3d point = 2 * Vec3d(normal(random), normal(random), normal(random));
            double volume = 0, area = 0;
            for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
                std::array<Vec3d, 4> p;
                std::array<double, 4> s{};
                for (std::size_t k = 0; k < 4; ++k) {
                    p[k] = mesh.points[mesh.tets[t][k]];
                    s[k] = (p[k] - point).dot(n);
                }
                volume += volume_of(mesh, t) * negative_part(s);
                area += section_area(p, s, n);
            }
            const TriMesh out = cutaway(mesh, by_plane(point, 3 * n, false));
            check(out, "cutaway");
            const Enclosed e = enclosed(out);
            EXPECT_NEAR(e.volume, volume, 1e-6 * volume);
            EXPECT_NEAR(e.interior_area, area, 1e-6 * area);
            EXPECT_LT(e.closing.norm(), 1e-6 * e.area);
            EXPECT_TRUE(closed_by_places(out));
            const auto& interior = out.find_face_property("interior")->values;
            for (std::size_t f = 0; f < out.triangles.size(); ++f)
                for (const VertexId v : out.triangles[f]) {
                    const double distance = (out.points[v].cast<double>() - point).dot(n);
                    EXPECT_LT(interior[f] > 0 ? std::abs(distance) : distance, 1e-5);
                }
        }
}

// A ball of many tetrahedra: the flat cut through its middle is nearly the disc.
TEST(Cutaway, OfABallIsADisc) {
    const double radius = 10;
    const TriMesh out = cutaway(ball_tets(radius, 0.5), by_plane(Vec3d::Zero(), {1, 2, 3}, false));
    const double disc = 3.14159265358979 * radius * radius;
    EXPECT_NEAR(enclosed(out).interior_area, disc, 0.05 * disc);
}

// Through lattice points, along faces of the tetrahedra: no splinters, no face counted from both sides.
TEST(Cutaway, ThroughThePointsOfALattice) {
    TetMesh mesh = kuhn_box(6, 6, 6, 0.1);
    set_faces(mesh);
    struct Case {
        Vec3d point, normal;
        double volume, area;
    };
    const double s = 0.6, root2 = std::sqrt(2.0), root3 = std::sqrt(3.0);
    for (const Case& c :
         {Case{{0, 0, 0.3}, {0, 0, 1}, s * s * 0.3, s * s},
          Case{{0, 0, 0}, {1, -1, 0}, s * s * s / 2, root2 * s * s},
          Case{{0.3, 0.3, 0.3}, {1, 1, 1}, s * s * s / 2, 0.75 * root3 * s * s},
          Case{{0, 0, 0.6}, {0, 0, 1}, s * s * s, 0}, Case{{0, 0, 0.35}, {0, 0, 1}, s * s * 0.35, s * s}}) {
        const TriMesh out = cutaway(mesh, by_plane(c.point, c.normal, false));
        const Enclosed e = enclosed(out);
        EXPECT_NEAR(e.volume, c.volume, 1e-6 * c.volume);
        EXPECT_NEAR(e.interior_area, c.area, 1e-6);
        EXPECT_TRUE(closed_by_places(out));
        for (const Triangle& t : out.triangles)
            EXPECT_GT((out.points[t[1]] - out.points[t[0]]).cross(out.points[t[2]] - out.points[t[0]]).norm(),
                      1e-4 * 0.01);
    }
    const TriMesh half = cutaway(mesh, by_plane({0, 0, 0.3}, {0, 0, 1}, false));
    EXPECT_EQ(half.triangles.size(), 2u * (36 + 36) + 4u * 2 * 18);
    EXPECT_EQ(half.find_face_property("interior")->values.size(), half.triangles.size());
}

TEST(Cutaway, FacesTellTheTetrahedronBehind) {
    TetMesh mesh = shaken(ball_tets(8, 1.5), 0.1);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        mesh.regions.push_back(centroid(mesh, t).x() < 0 ? 3 : 8);
    set_faces(mesh);
    std::set<std::array<float, 4>> shapes;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const Tetrahedron& v = mesh.tets[t];
        const TetShape s =
            tet_shape(mesh.points[v[0]], mesh.points[v[1]], mesh.points[v[2]], mesh.points[v[3]]);
        shapes.insert({static_cast<float>(s.min_dihedral_deg), static_cast<float>(s.radius_edge),
                       static_cast<float>(s.volume), static_cast<float>(mesh.regions[t])});
    }
    for (const CutawayOptions& o : {by_plane({0, 0.1, 0}, {0.3, 1, 0}, true),
                                    by_plane({0, 0.1, 0}, {0.3, 1, 0}, false), by_peel(200, {0, 9, 0})}) {
        const TriMesh out = cutaway(mesh, o);
        const char* const names[] = {"min_dihedral_deg", "radius_edge", "volume_A3", "region"};
        const auto& interior = out.find_face_property("interior")->values;
        std::size_t opened = 0;
        std::vector<int> used(out.points.size(), 0);
        for (std::size_t f = 0; f < out.triangles.size(); ++f) {
            std::array<float, 4> shape{};
            for (std::size_t i = 0; i < 4; ++i) shape[i] = out.find_face_property(names[i])->values[f];
            EXPECT_TRUE(shapes.count(shape));
            opened += interior[f] > 0;
            for (const VertexId v : out.triangles[f]) {
                ++used[v];
                EXPECT_EQ(out.find_vertex_property("interior")->values[v], interior[f]);
                for (std::size_t i = 0; i < 4; ++i) {
                    const float value = out.find_vertex_property(names[i])->values[v];
                    if (interior[f] > 0)
                        EXPECT_EQ(value, shape[i]);
                    else
                        EXPECT_TRUE(std::isnan(value));
                }
                // Behind the face: its region lies on its side of the mesh.
                if (std::abs(out.points[v].x()) > 2) {
                    EXPECT_EQ(shape[3], out.points[v].x() < 0 ? 3 : 8);
                }
            }
        }
        EXPECT_GT(opened, 50u);
        EXPECT_LT(opened, out.triangles.size());
        for (std::size_t v = 0; v < used.size(); ++v)
            if (out.find_vertex_property("interior")->values[v] > 0)
                EXPECT_EQ(used[v], 1);
            else
                EXPECT_GE(used[v], 1);
    }
}

TEST(Cutaway, PeelsBreadthFirst) {
    const TetMesh mesh = shaken(ball_tets(6, 1.2), 0.05);
    double all = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) all += volume_of(mesh, t);
    for (const std::uint64_t face : {std::uint64_t{0}, std::uint64_t{100}, mesh.faces.size() - 1})
        for (const std::size_t count : {1u, 2u, 5u, 100u, 700u}) {
            CutawayOptions o;
            o.peel = CutawayOptions::Peel{count, face, Vec3d::Zero()};
            std::size_t seed = 0;
            const Triangle& f = mesh.faces[face];
            const auto has = [&](VertexId v) {
                return std::count(mesh.tets[seed].begin(), mesh.tets[seed].end(), v) == 1;
            };
            while (!(has(f[0]) && has(f[1]) && has(f[2]))) ++seed;
            const std::set<std::size_t> gone = slow_peel(mesh, seed, count);
            ASSERT_EQ(gone.size(), count);
            double left = all;
            for (const std::size_t t : gone) left -= volume_of(mesh, t);
            const TriMesh out = cutaway(mesh, o);
            EXPECT_TRUE(closed_by_places(out));
            EXPECT_NEAR(enclosed(out).volume, left, 1e-6 * all);
            // Not the volume alone: the same faces are open.
            const TetMesh rest = kept_tets(mesh, [&](std::size_t t) { return gone.count(t) == 0; });
            EXPECT_EQ(out.triangles.size(), rest.faces.size());
        }
}

TEST(Cutaway, PeelsFromThePlaceGiven) {
    TetMesh mesh = kuhn_box(8, 8, 8);
    set_faces(mesh);
    const TriMesh out = cutaway(mesh, by_peel(30, {4, 20, 4}));
    const auto& interior = out.find_face_property("interior")->values;
    Vec3d middle = Vec3d::Zero();
    double count = 0;
    for (std::size_t f = 0; f < interior.size(); ++f)
        if (interior[f] > 0)
            for (const VertexId v : out.triangles[f]) middle += out.points[v].cast<double>(), count += 1;
    middle /= count;
    EXPECT_NEAR(middle.x(), 4, 2);
    EXPECT_NEAR(middle.y(), 7.5, 1);
    EXPECT_NEAR(middle.z(), 4, 2);
}

TEST(Cutaway, StopsWhereAComponentEnds) {
    TetMesh mesh = kuhn_box(2, 2, 2);
    const TetMesh other = kuhn_box(3, 3, 3);
    const auto shift = static_cast<VertexId>(mesh.points.size());
    for (const Vec3d& p : other.points) mesh.points.push_back(p + Vec3d(10, 0, 0));
    for (Tetrahedron t : other.tets) {
        for (VertexId& v : t) v += shift;
        mesh.tets.push_back(t);
    }
    set_faces(mesh);
    const TriMesh out = cutaway(mesh, by_peel(10000, {-1, 1, 1}));
    EXPECT_NEAR(enclosed(out).volume, 27, 1e-5);
    for (const float v : out.find_face_property("interior")->values) EXPECT_EQ(v, 0);
    EXPECT_NEAR(enclosed(cutaway(mesh, by_peel(10000, {20, 1, 1}))).volume, 8, 1e-5);
}

TEST(Cutaway, RefusesWhatMakesNoSense) {
    TetMesh mesh = kuhn_box(3, 3, 3);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        mesh.regions.push_back(centroid(mesh, t).x() < 1 ? 1 : 2);
    set_faces(mesh);
    EXPECT_THROW(cutaway(mesh, {}), InvalidInput);
    CutawayOptions both = by_peel(1, {0, 0, 0});
    both.plane = CutawayOptions::Plane{};
    EXPECT_THROW(cutaway(mesh, both), InvalidInput);
    EXPECT_THROW(cutaway(mesh, by_plane({0, 0, 0}, {0, 0, 0}, true)), InvalidInput);
    EXPECT_THROW(cutaway(mesh, by_plane({0, 0, 0}, {0, NAN, 0}, true)), InvalidInput);
    EXPECT_THROW(cutaway(mesh, by_plane({INFINITY, 0, 0}, {0, 1, 0}, true)), InvalidInput);
    EXPECT_THROW(cutaway(mesh, by_peel(1, {NAN, 0, 0})), InvalidInput);
    EXPECT_THROW(cutaway({}, by_peel(1, {0, 0, 0})), InvalidInput);
    EXPECT_THROW(cutaway(kuhn_box(2, 2, 2), by_peel(1, {0, 0, 0})), InvalidInput);  // no faces set
    CutawayOptions peel = by_peel(1, {0, 0, 0});
    peel.peel->seed_face = mesh.faces.size();
    EXPECT_THROW(cutaway(mesh, peel), InvalidInput);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f)
        if (mesh.face_regions[f][1] != 0) peel.peel->seed_face = f;  // between the regions
    EXPECT_THROW(cutaway(mesh, peel), InvalidInput);
    EXPECT_THROW(cutaway(mesh, by_peel(162, {0, 0, 0})), NumericalError);
    EXPECT_NO_THROW(cutaway(mesh, by_peel(161, {0, 0, 0})));
    for (const bool whole : {true, false})
        EXPECT_THROW(cutaway(mesh, by_plane({0, 0, -1}, {0, 0, 1}, whole)), NumericalError);
    EXPECT_THROW(cutaway(mesh, by_peel(1, {0, 0, 0}), Progress([](double) { return false; })), Cancelled);
}

TEST(Cutaway, SameForAnyThreads) {
    TetMesh mesh = shaken(kuhn_box(20, 20, 20), 0.1);
    set_faces(mesh);
    for (const CutawayOptions& o : {by_plane({10, 10, 10}, {1, 2, 3}, true),
                                    by_plane({10, 10, 10}, {1, 2, 3}, false), by_peel(9000, {0, 0, 0})}) {
        std::vector<TriMesh> all;
        for (const std::size_t threads : {2u, 1u}) {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
            all.push_back(cutaway(mesh, o));
        }
        EXPECT_EQ(all[0].points, all[1].points);
        EXPECT_EQ(all[0].triangles, all[1].triangles);
        for (std::size_t i = 0; i < all[0].face_properties.size(); ++i)
            EXPECT_EQ(all[0].face_properties[i].values, all[1].face_properties[i].values);
    }
}
