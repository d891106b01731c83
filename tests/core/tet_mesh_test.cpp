// Tetrahedral meshes: what is refused, which lie against which, their faces and boundary.
#include "vdbgeo/core/tet_mesh.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <string>

#include "tests/support/tet_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

constexpr std::uint32_t none = TetAdjacency::none;

Triangle face_of(const TetMesh& mesh, std::size_t t, std::size_t k) {
    Triangle face{};
    for (std::size_t c = 0; c < 3; ++c) face[c] = mesh.tets[t][static_cast<std::size_t>(tet_faces[k][c])];
    return face;
}

Triangle sorted(Triangle t) {
    std::sort(t.begin(), t.end());
    return t;
}

/// By a map from faces to those who have them.
std::vector<std::array<std::uint32_t, 4>> slow_adjacency(const TetMesh& mesh) {
    std::map<Triangle, std::vector<std::pair<std::size_t, std::size_t>>> owners;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (std::size_t k = 0; k < 4; ++k) owners[sorted(face_of(mesh, t, k))].emplace_back(t, k);
    std::vector<std::array<std::uint32_t, 4>> neighbour(mesh.tets.size(), {none, none, none, none});
    for (const auto& [face, who] : owners) {
        if (who.size() != 2) continue;
        neighbour[who[0].first][who[0].second] = static_cast<std::uint32_t>(who[1].first);
        neighbour[who[1].first][who[1].second] = static_cast<std::uint32_t>(who[0].first);
    }
    return neighbour;
}

/// The same mesh with its points, tetrahedra and corners in any order.
TetMesh shuffled(const TetMesh& mesh, unsigned seed) {
    std::mt19937 random(seed);
    TetMesh out = mesh;
    std::vector<VertexId> number(mesh.points.size());
    std::iota(number.begin(), number.end(), 0u);
    std::shuffle(number.begin(), number.end(), random);
    for (std::size_t v = 0; v < number.size(); ++v) out.points[number[v]] = mesh.points[v];
    std::shuffle(out.tets.begin(), out.tets.end(), random);
    for (Tetrahedron& t : out.tets) {
        for (VertexId& v : t) v = number[v];
        std::shuffle(t.begin(), t.end(), random);
        t = turned_right(out.points, t);
    }
    return out;
}

std::string what_of(const TetMesh& mesh) {
    try {
        tet_adjacency(mesh);
    } catch (const InvalidInput& e) {
        return e.what();
    }
    return "";
}

/// Twice Σ areas as vectors, and six times the volume, of the faces of one region.
std::pair<Vec3d, double> closure(const TetMesh& mesh, std::int32_t region) {
    Vec3d area = Vec3d::Zero();
    double volume = 0;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const double side = mesh.face_regions[f][0] == region   ? 1
                            : mesh.face_regions[f][1] == region ? -1
                                                                : 0;
        const Vec3d &a = mesh.points[mesh.faces[f][0]], &b = mesh.points[mesh.faces[f][1]],
                    &c = mesh.points[mesh.faces[f][2]];
        area += side * (b - a).cross(c - a);
        volume += side * a.dot(b.cross(c));
    }
    return {area, volume};
}

}  // namespace

TEST(TetMesh, FacesLookOutward) {
    const TetMesh mesh = one_tet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    ASSERT_GT(tet_determinant(mesh, 0), 0);
    ASSERT_EQ(mesh.faces.size(), 4u);
    for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(mesh.faces[k], face_of(mesh, 0, k));
        EXPECT_EQ(mesh.face_regions[k], (std::array<std::int32_t, 2>{1, 0}));
        const Triangle& f = mesh.faces[k];
        EXPECT_EQ(std::count(f.begin(), f.end(), mesh.tets[0][k]), 0);
        EXPECT_LT(tet_determinant(mesh.points[f[0]], mesh.points[f[1]], mesh.points[f[2]],
                                  mesh.points[mesh.tets[0][k]]),
                  0);
    }
    for (const auto& [i, j] : tet_edges) EXPECT_LT(i, j);
}

TEST(TetAdjacency, IsThatOfItsTwin) {
    for (const TetMesh& mesh : {TetMesh{}, regular_tet(), kuhn_box(4, 5, 6), ball_tets(5, 1),
                                shuffled(kuhn_box(7, 6, 5), 1), shuffled(bcc_lattice(6, 6, 6), 2)}) {
        const TetAdjacency fast = tet_adjacency(mesh);
        const auto slow = slow_adjacency(mesh);
        ASSERT_EQ(fast.neighbour.size(), slow.size());
        EXPECT_TRUE(std::equal(slow.begin(), slow.end(), fast.neighbour.begin()));
    }
}

TEST(TetAdjacency, DoesNotDependOnTheNumberOfThreads) {
    const TetMesh mesh = shuffled(kuhn_box(24, 24, 24), 3);
    std::vector<TetAdjacency> all;
    std::vector<Array<Triangle>> faces;
    for (const std::size_t threads : {1u, 2u, 4u}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        all.push_back(tet_adjacency(mesh));
        TetMesh with_faces = mesh;
        set_faces(with_faces);
        faces.push_back(with_faces.faces);
    }
    for (std::size_t i = 1; i < all.size(); ++i) {
        EXPECT_EQ(all[i].neighbour, all[0].neighbour);
        EXPECT_EQ(faces[i], faces[0]);
    }
}

TEST(TetAdjacency, RefusesWhatIsNoMesh) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {0, 0, 2}, {1, 1, 1}};
    mesh.tets = {{0, 1, 2, 3}, {0, 2, 1, 4}};
    EXPECT_EQ(what_of(mesh), "");
    EXPECT_EQ(tet_adjacency(mesh).neighbour[0][3], 1u);
    mesh.tets.push_back({0, 1, 2, 5});
    EXPECT_EQ(what_of(mesh), "the triangle of vertices 0, 1, 2 has more than two tetrahedra");
    mesh.tets = {{0, 1, 2, 3}, {1, 0, 6, 4}, {0, 1, 2, 5}};
    EXPECT_EQ(what_of(mesh), "the triangle of vertices 0, 1, 2 has two tetrahedra on the same side");
    mesh.tets = {{0, 1, 2, 3}, {1, 0, 6, 1}};
    EXPECT_EQ(what_of(mesh), "tetrahedron 1 names vertex 1 twice");
    mesh.tets = {{0, 1, 2, 3}, {0, 1, 2, 3}};
    EXPECT_NE(what_of(mesh), "");
    mesh.faces = {{0, 1, 2}};
    EXPECT_THROW(set_faces(mesh), InvalidInput);
    EXPECT_EQ(mesh.faces.size(), 1u);  // as it was
}

// The message is that of the first fault in order, whichever thread meets one first.
TEST(TetAdjacency, TellsTheSameFaultWithAnyThreads) {
    TetMesh mesh = shuffled(kuhn_box(20, 20, 20), 4);
    for (std::size_t t = 0; t < 4000; t += 7) {
        mesh.tets.push_back(mesh.tets[t]);
        std::swap(mesh.tets.back()[0], mesh.tets.back()[1]);
    }
    std::vector<std::string> told;
    for (const std::size_t threads : {1u, 2u, 4u}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        told.push_back(what_of(mesh));
    }
    EXPECT_NE(told[0], "");
    EXPECT_EQ(told[1], told[0]);
    EXPECT_EQ(told[2], told[0]);
}

// All tetrahedra around one vertex, whose number is between those of the others: one bucket has most faces.
TEST(TetAdjacency, OfAFullBucket) {
    TetMesh mesh = kuhn_box(20, 20, 20);
    set_faces(mesh);
    Array<Triangle> shell = mesh.faces;
    const auto hub = static_cast<VertexId>(mesh.points.size() / 2);
    mesh.points[hub] = Vec3d::Constant(10.1);  // inside the box: no face of the shell has it
    mesh.tets.clear();
    for (const Triangle& f : shell) mesh.tets.push_back(turned_right(mesh.points, {f[0], f[1], f[2], hub}));
    const TetAdjacency fast = tet_adjacency(mesh);
    const auto slow = slow_adjacency(mesh);
    EXPECT_TRUE(std::equal(slow.begin(), slow.end(), fast.neighbour.begin()));
    set_faces(mesh);
    EXPECT_EQ(mesh.faces.size(), shell.size());
}

TEST(TetMesh, FacesAreThoseOfTheRegions) {
    TetMesh mesh = kuhn_box(6, 5, 4);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        mesh.regions.push_back(centroid(mesh, t).x() < 2 ? 5 : centroid(mesh, t).y() < 2 ? 1 : 3);
    set_faces(mesh);
    check(mesh, "mesh");
    // In the order of the tetrahedra, then of their faces.
    const auto neighbours = slow_adjacency(mesh);
    std::size_t f = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (std::size_t k = 0; k < 4; ++k) {
            const std::int32_t other = neighbours[t][k] == none ? 0 : mesh.regions[neighbours[t][k]];
            if (other != 0 && other <= mesh.regions[t]) continue;
            ASSERT_LT(f, mesh.faces.size());
            EXPECT_EQ(mesh.faces[f], face_of(mesh, t, k));
            EXPECT_EQ(mesh.face_regions[f], (std::array<std::int32_t, 2>{mesh.regions[t], other}));
            ++f;
        }
    EXPECT_EQ(f, mesh.faces.size());
    // Each region is closed and encloses its tetrahedra.
    const std::map<std::int32_t, double> volumes{{5, 2 * 5 * 4}, {1, 4 * 2 * 4}, {3, 4 * 3 * 4}};
    for (const auto& [region, volume] : volumes) {
        const auto [area, sixfold] = closure(mesh, region);
        EXPECT_LT(area.norm(), 1e-12);
        EXPECT_NEAR(sixfold / 6, volume, 1e-10);
    }
}

TEST(TetMesh, BoundarySurfaces) {
    TetMesh mesh = kuhn_box(4, 3, 2);
    mesh.points.push_back({9, 9, 9});  // used by none
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        mesh.regions.push_back(centroid(mesh, t).x() < 1 ? 2 : 1);
    set_faces(mesh);
    const auto volume = [](const TriMesh& m) {
        double sum = 0;
        for (const Triangle& t : m.triangles)
            sum += static_cast<double>(m.points[t[0]].dot(m.points[t[1]].cross(m.points[t[2]])));
        return sum / 6;
    };
    const TriMesh all = boundary_surface(mesh);
    check(all, "boundary");
    EXPECT_EQ(all.triangles.size(), 4u * (12 + 6 + 8));
    EXPECT_EQ(all.points.size(), 60u - 3 * 2 * 1);  // without those inside
    EXPECT_NEAR(volume(all), 24, 1e-5);
    const MeshProperty* region = all.find_face_property("region");
    ASSERT_TRUE(region);
    EXPECT_EQ(std::count(region->values.begin(), region->values.end(), 2.0f),
              2 * 6 + 2 * (2 * 3 + 2 * 2) * 1);
    const TriMesh one = boundary_surface(mesh, 1), two = boundary_surface(mesh, 2);
    EXPECT_NEAR(volume(one), 18, 1e-5);
    EXPECT_NEAR(volume(two), 6, 1e-5);
    for (const float r : two.find_face_property("region")->values) EXPECT_EQ(r, 2);
    EXPECT_TRUE(boundary_surface(mesh, 7).empty());
    EXPECT_TRUE(boundary_surface({}).empty());
}

TEST(TetMesh, CheckTellsTheFirstFault) {
    const auto fault = [](const auto& damage) -> std::string {
        TetMesh mesh = kuhn_box(3, 3, 3);
        set_faces(mesh);
        damage(mesh);
        try {
            check(mesh, "file");
        } catch (const InvalidInput& e) {
            return e.what();
        }
        return "";
    };
    EXPECT_EQ(fault([](TetMesh&) {}), "");
    EXPECT_EQ(fault([](TetMesh& m) { m.tets[5][1] = m.tets[9][2] = 64; }),
              "file: tetrahedron 5 names vertex 64 of 64");
    EXPECT_EQ(fault([](TetMesh& m) { m.faces[2][0] = 99; }), "file: face 2 names vertex 99 of 64");
    EXPECT_EQ(fault([](TetMesh& m) { m.points[7].y() = std::numeric_limits<double>::quiet_NaN(); }),
              "file: vertex 7 has a coordinate that is not a finite number");
    EXPECT_EQ(fault([](TetMesh& m) { m.regions.resize(3); }), "file: 3 regions for 162 tetrahedra");
    EXPECT_EQ(fault([](TetMesh& m) {
                  m.regions.assign(162, 1);
                  m.regions[4] = 0;
              }),
              "file: tetrahedron 4 is in region 0; regions count from 1");
    EXPECT_NE(fault([](TetMesh& m) { m.face_regions.pop_back(); }), "");
    EXPECT_NE(fault([](TetMesh& m) { m.tet_properties.push_back({"p", 1, {1, 2}}); }), "");
    EXPECT_NE(fault([](TetMesh& m) { m.vertex_properties.push_back({"p", 0, {}}); }), "");
}
