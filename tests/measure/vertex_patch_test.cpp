#include "vdbgeo/measure/vertex_patch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>
#include <vector>

#include "tests/support/meshes.h"
#include "tests/support/small_meshes.h"

namespace vdbgeo {
namespace {

using test::icosphere;
using test::joined;
using Member = VertexPatch::Member;

TriMesh rough_torus() {
    TriMesh mesh = test::torus_mesh(3, 1, 30, 14);
    std::mt19937 random(7);
    std::uniform_real_distribution<float> jump(-0.05f, 0.05f);
    for (Vec3f& p : mesh.points) p += Vec3f(jump(random), jump(random), jump(random));
    return mesh;
}

/// Adjacency as plain sets, from the faces.
std::vector<std::set<VertexId>> links(const TriMesh& mesh) {
    std::vector<std::set<VertexId>> out(mesh.points.size());
    for (const Triangle& t : mesh.triangles)
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                if (i != j) out[t[i]].insert(t[j]);
    return out;
}

double apart(const TriMesh& mesh, VertexId a, VertexId b) {
    return (mesh.points[a].cast<double>() - mesh.points[b].cast<double>()).norm();
}

/// Shortest ways by relaxing every edge until nothing changes.
std::vector<double> ways(const TriMesh& mesh, VertexId from, bool count_edges) {
    const auto next = links(mesh);
    std::vector<double> way(mesh.points.size(), std::numeric_limits<double>::infinity());
    way[from] = 0;
    for (bool changed = true; changed;) {
        changed = false;
        for (VertexId a = 0; a < way.size(); ++a)
            for (const VertexId b : next[a]) {
                const double w = way[a] + (count_edges ? 1 : apart(mesh, a, b));
                if (w < way[b]) way[b] = w, changed = true;
            }
    }
    return way;
}

std::vector<VertexId> sorted_vertices(const std::vector<Member>& members) {
    std::vector<VertexId> out;
    for (const Member& m : members) out.push_back(m.vertex);
    std::sort(out.begin(), out.end());
    return out;
}

std::vector<VertexId> within(const std::vector<double>& way, double limit) {
    std::vector<VertexId> out;
    for (VertexId v = 0; v < way.size(); ++v)
        if (way[v] <= limit) out.push_back(v);
    return out;
}

void expect_rising(const std::vector<Member>& members) {
    EXPECT_TRUE(std::is_sorted(members.begin(), members.end(),
                               [](const Member& a, const Member& b) { return a.distance < b.distance; }));
}

TEST(VertexPatch, RingsAreThoseOfTheFewestEdges) {
    const TriMesh mesh = rough_torus();
    const VertexNeighbours neighbours(mesh);
    VertexPatch patch(mesh, neighbours);
    for (const VertexId v : {0u, 17u, 200u, 419u}) {
        const auto way = ways(mesh, v, true);
        for (int k = 0; k <= 5; ++k) {
            const auto& found = patch.rings(v, k);
            EXPECT_EQ(sorted_vertices(found), within(way, k)) << v << " " << k;
            EXPECT_EQ(found[0].vertex, v);
            expect_rising(found);
            for (const Member& m : found) EXPECT_EQ(m.distance, way[m.vertex]);
        }
    }
}

TEST(VertexPatch, BallIsConnectedInsideItself) {
    const TriMesh mesh = rough_torus();
    const VertexNeighbours neighbours(mesh);
    const auto next = links(mesh);
    VertexPatch patch(mesh, neighbours);
    for (const VertexId v : {3u, 101u, 333u})
        for (const double radius : {0.0, 0.3, 0.9, 1.7, 2.5, 20.0}) {
            std::set<VertexId> expected{v};
            for (bool grown = true; grown;) {
                grown = false;
                for (const VertexId a : std::set<VertexId>(expected))
                    for (const VertexId b : next[a])
                        if (apart(mesh, v, b) <= radius && expected.insert(b).second) grown = true;
            }
            const auto& found = patch.ball(v, radius);
            EXPECT_EQ(sorted_vertices(found), std::vector<VertexId>(expected.begin(), expected.end()))
                << v << " " << radius;
            EXPECT_EQ(found[0].vertex, v);
            for (const Member& m : found) EXPECT_NEAR(m.distance, apart(mesh, v, m.vertex), 1e-6);
        }
}

TEST(VertexPatch, AnotherSheetNearbyIsNotFound) {
    const TriMesh outer = icosphere(3, 1.05), inner = test::flipped(icosphere(3, 1));
    const TriMesh shell = joined(outer, inner);
    const VertexNeighbours neighbours(shell);
    VertexPatch patch(shell, neighbours);
    for (VertexId v = 0; v < outer.points.size(); v += 50) {
        for (const Member& m : patch.ball(v, 0.5)) EXPECT_LT(m.vertex, outer.points.size());
        for (const Member& m : patch.geodesic(v, 0.5)) EXPECT_LT(m.vertex, outer.points.size());
    }
}

TEST(VertexPatch, GeodesicIsTheShortestWayAlongEdges) {
    const TriMesh mesh = rough_torus();
    const VertexNeighbours neighbours(mesh);
    VertexPatch patch(mesh, neighbours);
    for (const VertexId v : {5u, 77u, 401u}) {
        const auto way = ways(mesh, v, false);
        for (const double radius : {0.0, 0.5, 2.0, 6.0, 100.0}) {
            const auto& found = patch.geodesic(v, radius);
            EXPECT_EQ(sorted_vertices(found), within(way, radius));
            EXPECT_EQ(found[0].vertex, v);
            expect_rising(found);
            for (const Member& m : found) EXPECT_NEAR(m.distance, way[m.vertex], 1e-5);
        }
    }
}

TEST(VertexPatch, OnePatchLeavesNothingInTheNext) {
    const TriMesh mesh = rough_torus();
    const VertexNeighbours neighbours(mesh);
    VertexPatch used(mesh, neighbours);
    for (int round = 0; round < 3; ++round)
        for (const VertexId v : {9u, 10u, 300u}) {
            VertexPatch fresh(mesh, neighbours);
            EXPECT_EQ(sorted_vertices(used.rings(v, 3)), sorted_vertices(fresh.rings(v, 3)));
            EXPECT_EQ(sorted_vertices(used.geodesic(v, 1.5)), sorted_vertices(fresh.geodesic(v, 1.5)));
            EXPECT_EQ(sorted_vertices(used.ball(v, 1.5)), sorted_vertices(fresh.ball(v, 1.5)));
        }
}

TEST(VertexPatch, AnIsolatedVertexIsAlone) {
    TriMesh mesh = test::tetrahedron();
    mesh.points.push_back({0.1f, 0.1f, 0.1f});
    const VertexNeighbours neighbours(mesh);
    VertexPatch patch(mesh, neighbours);
    EXPECT_EQ(patch.rings(4, 3).size(), 1u);
    EXPECT_EQ(patch.ball(4, 10).size(), 1u);
    EXPECT_EQ(patch.geodesic(4, 10).size(), 1u);
    EXPECT_EQ(patch.rings(0, 3).size(), 4u);
}

}  // namespace
}  // namespace vdbgeo
