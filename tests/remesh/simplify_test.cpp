#include "vdbgeo/remesh/simplify.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <map>
#include <set>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/surface_distance.h"

using namespace vdbgeo;
using namespace vdbgeo::test;

namespace {

struct Shape {
    std::uint64_t borders = 0, components = 0;
    int euler = 0;
    bool manifold = true;
    double area = 0, volume = 0;
};

/// Counted with maps and sets from the faces alone; points that no face names make it no manifold.
Shape shape_of(const TriMesh& mesh) {
    Shape shape;
    std::map<std::pair<VertexId, VertexId>, int> directed;
    std::vector<std::map<VertexId, VertexId>> links(mesh.points.size());
    std::vector<VertexId> parent(mesh.points.size());
    for (VertexId v = 0; v < parent.size(); ++v) parent[v] = v;
    const auto root = [&](VertexId v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        shape.area += (b - a).cross(c - a).norm() / 2;
        shape.volume += a.dot(b.cross(c)) / 6;
        for (std::size_t i = 0; i < 3; ++i) {
            const VertexId u = t[i], v = t[(i + 1) % 3], w = t[(i + 2) % 3];
            if (++directed[{u, v}] > 1) shape.manifold = false;
            if (!links[u].emplace(v, w).second) shape.manifold = false;
            parent[root(u)] = root(v);
        }
    }
    std::uint64_t edges = 0;
    for (const auto& [edge, count] : directed) {
        const bool border = directed.count({edge.second, edge.first}) == 0;
        if (border) ++shape.borders;
        if (border || edge.first < edge.second) ++edges;
    }
    for (VertexId v = 0; v < links.size(); ++v) {
        if (parent[v] == v) ++shape.components;
        // The link is one chain or one ring.
        std::set<VertexId> ends;
        for (const auto& [from, to] : links[v]) ends.insert(to);
        VertexId start = links[v].empty() ? v : links[v].begin()->first;
        for (const auto& [from, to] : links[v])
            if (!ends.count(from)) start = from;
        std::size_t steps = 0;
        for (VertexId w = start; links[v].count(w) && steps <= links[v].size(); w = links[v].at(w)) {
            ++steps;
            if (links[v].at(w) == start) break;
        }
        if (links[v].empty() || steps != links[v].size()) shape.manifold = false;
    }
    shape.euler = static_cast<int>(mesh.points.size()) - static_cast<int>(edges) +
                  static_cast<int>(mesh.triangles.size());
    return shape;
}

TriMesh to_faces(const TriMesh& mesh, std::uint64_t faces) {
    SimplifyOptions options;
    options.faces = faces;
    return simplify(mesh, options);
}

TriMesh within_distance(const TriMesh& mesh, double distance) {
    SimplifyOptions options;
    options.max_distance = distance;
    return simplify(mesh, options);
}

/// A closed can of radius 10 and height 30; its lids, fans about a middle point, are caps.
TriMesh can() {
    const int rows = 24, around = 96;
    TriMesh mesh = open_cylinder_mesh(10, 30, rows, around);
    MeshProperty cap{cap_property, 1, std::vector<float>(mesh.triangles.size(), 0)};
    for (const int end : {0, 1}) {
        const VertexId middle = static_cast<VertexId>(mesh.points.size());
        mesh.points.push_back(Vec3f(0, 0, end ? 15.0f : -15.0f));
        for (int c = 0; c < around; ++c) {
            const VertexId u = static_cast<VertexId>(end * rows * around + c),
                           v = static_cast<VertexId>(end * rows * around + (c + 1) % around);
            mesh.triangles.push_back(end ? Triangle{u, v, middle} : Triangle{v, u, middle});
            cap.values.push_back(1);
        }
    }
    mesh.face_properties.push_back(cap);
    return mesh;
}

bool same_bytes(const TriMesh& a, const TriMesh& b) {
    return a.points == b.points && a.triangles == b.triangles;
}

void expect_refused(const TriMesh& mesh, const std::string& part) {
    try {
        to_faces(mesh, 4);
        FAIL() << "not refused: " << part;
    } catch (const InvalidInput& e) {
        const std::string what = e.what();
        EXPECT_EQ(what.find("simplify needs a manifold mesh: "), 0u) << what;
        EXPECT_NE(what.find(part), std::string::npos) << what;
        EXPECT_NE(what.find("; try repair"), std::string::npos) << what;
    }
}

}  // namespace

TEST(Simplify, SphereToATenth) {
    const TriMesh sphere = icosphere(5, 10), fewer = to_faces(sphere, 2048);
    const Shape before = shape_of(sphere), after = shape_of(fewer);
    EXPECT_EQ(fewer.triangles.size(), 2048u);
    EXPECT_TRUE(after.manifold);
    EXPECT_EQ(after.borders, 0u);
    EXPECT_EQ(after.euler, 2);
    EXPECT_NEAR(after.volume, before.volume, 0.004 * before.volume);
    EXPECT_NEAR(after.area, before.area, 0.005 * before.area);
    // The sagitta of triangles with this many on the sphere is 0.02; a few times that at the worst place.
    EXPECT_LT(surface_distance(sphere, fewer).hausdorff, 0.06);
}

TEST(Simplify, GenusAndComponentsStay) {
    const TriMesh two = joined(torus_mesh(20, 6), moved(icosphere(3, 5), Mat3d::Identity(), Vec3d(50, 0, 0)));
    for (const std::uint64_t faces : {4000u, 1000u, 300u, 100u}) {
        const TriMesh fewer = to_faces(two, faces);
        const Shape shape = shape_of(fewer);
        EXPECT_EQ(fewer.triangles.size(), faces);
        EXPECT_TRUE(shape.manifold);
        EXPECT_EQ(shape.borders, 0u);
        EXPECT_EQ(shape.components, 2u);
        EXPECT_EQ(shape.euler, 2);
        EXPECT_GT(shape.volume, 0);
    }
}

TEST(Simplify, StopsWhereItMust) {
    // Nothing of a torus or of twenty small balls may vanish.
    TriMesh mesh = torus_mesh(20, 6);
    for (int i = 0; i < 20; ++i)
        mesh = joined(mesh, moved(icosphere(1, 1), Mat3d::Identity(), Vec3d(40 + 3 * i, 0, 0)));
    const TriMesh least = to_faces(mesh, 0);
    const Shape shape = shape_of(least);
    EXPECT_TRUE(shape.manifold);
    EXPECT_EQ(shape.borders, 0u);
    EXPECT_EQ(shape.components, 21u);
    EXPECT_EQ(shape.euler, 40);
    EXPECT_GE(least.triangles.size(), 14u + 20 * 4);
    EXPECT_LT(least.triangles.size(), 20 * 20 + 150u);
    const TriMesh tetrahedron = to_faces(icosphere(0, 1), 0);
    EXPECT_GE(tetrahedron.triangles.size(), 4u);
    EXPECT_TRUE(same_bytes(to_faces(tetrahedron, 0), tetrahedron));
}

TEST(Simplify, BordersStay) {
    const TriMesh pipe = open_cylinder_mesh(10, 30), fewer = to_faces(pipe, 600);
    const Shape before = shape_of(pipe), after = shape_of(fewer);
    EXPECT_LE(fewer.triangles.size(), 600u);
    EXPECT_GE(fewer.triangles.size(), 599u);
    EXPECT_TRUE(after.manifold);
    EXPECT_EQ(after.euler, 0);
    EXPECT_GT(after.borders, 20u);
    EXPECT_LT(after.borders, before.borders);
    EXPECT_NEAR(after.area, before.area, 0.01 * before.area);
    float low = 0, high = 0;
    for (const Vec3f& p : fewer.points) low = std::min(low, p.z()), high = std::max(high, p.z());
    EXPECT_NEAR(low, -15, 1e-3);
    EXPECT_NEAR(high, 15, 1e-3);
    EXPECT_LT(surface_distance(pipe, fewer).hausdorff, 0.3);
}

TEST(Simplify, BordersAreNotJoined) {
    // Down to what cannot go: no edge between two borders, or between two places of one, may vanish.
    const TriMesh strip = open_cylinder_mesh(10, 1, 1, 24);
    TriMesh meshes = strip;
    for (const double height : {2.0, 30.0})
        meshes = joined(meshes,
                        moved(open_cylinder_mesh(10, height), Mat3d::Identity(), Vec3d(0, 0, 10 + height)));
    const TriMesh least = to_faces(meshes, 0);
    const Shape shape = shape_of(least);
    EXPECT_TRUE(shape.manifold);
    EXPECT_EQ(shape.components, 3u);
    EXPECT_EQ(shape.euler, 0);
    EXPECT_GE(shape.borders, 18u);
}

TEST(Simplify, AFlatSquareKeepsItsCorners) {
    TriMesh square;
    const VertexId n = 31;
    for (VertexId y = 0; y < n; ++y)
        for (VertexId x = 0; x < n; ++x) square.points.push_back(Vec3d(x, y, 0).cast<float>());
    for (VertexId y = 0; y + 1 < n; ++y)
        for (VertexId x = 0; x + 1 < n; ++x) {
            const VertexId v = y * n + x;
            square.triangles.push_back({v, v + 1, v + n + 1});
            square.triangles.push_back({v, v + n + 1, v + n});
        }
    const TriMesh fewer = to_faces(square, 60);
    const Shape shape = shape_of(fewer);
    EXPECT_LE(fewer.triangles.size(), 60u);
    EXPECT_TRUE(shape.manifold);
    EXPECT_EQ(shape.euler, 1);
    EXPECT_NEAR(shape.area, 900, 0.5);
    EXPECT_LT(surface_distance(square, fewer).hausdorff, 0.05);
}

TEST(Simplify, CapsKeepTheirRims) {
    const TriMesh full = can(), fewer = to_faces(full, 500);
    const Shape shape = shape_of(fewer);
    EXPECT_TRUE(shape.manifold);
    EXPECT_EQ(shape.euler, 2);
    EXPECT_EQ(fewer.triangles.size(), 500u);
    const MeshProperty* cap = fewer.find_face_property(cap_property);
    ASSERT_TRUE(cap);
    ASSERT_EQ(cap->values.size(), fewer.triangles.size());
    double lids = 0;
    for (std::size_t f = 0; f < fewer.triangles.size(); ++f) {
        const Triangle& t = fewer.triangles[f];
        const Vec3f a = fewer.points[t[0]], b = fewer.points[t[1]], c = fewer.points[t[2]];
        const Vec3f normal = (b - a).cross(c - a);
        if (cap->values[f] > 0.5f) {
            lids += normal.norm() / 2;
            for (const Vec3f& p : {a, b, c}) EXPECT_NEAR(std::abs(p.z()), 15, 2e-3);
        } else {
            EXPECT_LT(std::abs(normal.z()), 0.2 * normal.norm());  // the wall
        }
    }
    EXPECT_NEAR(lids, 2 * M_PI * 100, 0.02 * 2 * M_PI * 100);
}

TEST(Simplify, PropertiesAreCarried) {
    TriMesh mesh = icosphere(4, 10);
    MeshProperty place{"place", 3, {}}, number{"number", 1, {}};
    for (const Vec3f& p : mesh.points)
        for (int a = 0; a < 3; ++a) place.values.push_back(p[a]);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) number.values.push_back(static_cast<float>(f));
    mesh.vertex_properties.push_back(place);
    mesh.face_properties.push_back(number);
    const TriMesh fewer = to_faces(mesh, 500);
    EXPECT_NO_THROW(check(fewer, "result"));
    const MeshProperty* places = fewer.find_vertex_property("place");
    const MeshProperty* numbers = fewer.find_face_property("number");
    ASSERT_TRUE(places && numbers);
    std::set<float> faces;
    for (std::size_t v = 0; v < fewer.points.size(); ++v) {
        const Vec3f from(places->values[3 * v], places->values[3 * v + 1], places->values[3 * v + 2]);
        EXPECT_LT((from - fewer.points[v]).norm(), 2.0f);  // two edges of the result
        EXPECT_NEAR(from.norm(), 10, 1e-4);                // of one vertex, not a mean of several
    }
    for (std::size_t f = 0; f < fewer.triangles.size(); ++f) {
        faces.insert(numbers->values[f]);
        const Triangle& now = fewer.triangles[f];
        const Triangle& then = mesh.triangles[static_cast<std::size_t>(numbers->values[f])];
        const Vec3f middle_now = fewer.points[now[0]] + fewer.points[now[1]] + fewer.points[now[2]];
        const Vec3f middle_then = mesh.points[then[0]] + mesh.points[then[1]] + mesh.points[then[2]];
        EXPECT_LT((middle_now - middle_then).norm() / 3, 3.0f);
    }
    EXPECT_EQ(faces.size(), fewer.triangles.size());
}

TEST(Simplify, TheDistanceIsKept) {
    const TriMesh torus = torus_mesh(20, 6, 120, 60);
    std::size_t last = torus.triangles.size();
    for (const double bound : {0.02, 0.1, 1.0}) {
        const TriMesh fewer = within_distance(torus, bound);
        EXPECT_LE(surface_distance(torus, fewer).hausdorff, bound);
        EXPECT_LE(surface_distance(fewer, torus, {0.2}).hausdorff, 1.05 * bound);
        EXPECT_LT(fewer.triangles.size(), last);
        EXPECT_TRUE(shape_of(fewer).manifold);
        EXPECT_EQ(shape_of(fewer).euler, 0);
        last = fewer.triangles.size();
    }
    EXPECT_LT(last, 600u);
    SimplifyOptions both;
    both.faces = 9000;
    both.max_distance = 1.0;
    EXPECT_EQ(simplify(torus, both).triangles.size(), 9000u);
    both.faces = 100;
    both.max_distance = 0.1;
    EXPECT_TRUE(same_bytes(simplify(torus, both), within_distance(torus, 0.1)));
}

TEST(Simplify, WhatIsSmallEnoughComesBack) {
    const TriMesh sphere = icosphere(2, 10);
    EXPECT_TRUE(same_bytes(to_faces(sphere, sphere.triangles.size()), sphere));
    EXPECT_TRUE(to_faces(TriMesh(), 10).empty());
}

TEST(Simplify, FarFromTheOrigin) {
    const Vec3d shift(3000, -5000, 8000);
    const TriMesh sphere = icosphere(5, 10), far = moved(sphere, Mat3d::Identity(), shift);
    const TriMesh fewer = to_faces(far, 2048);
    EXPECT_EQ(shape_of(fewer).euler, 2);
    EXPECT_LT(surface_distance(far, fewer).hausdorff, 0.06);
}

TEST(Simplify, RefusesWhatIsNoManifold) {
    TriMesh fin = icosphere(2, 10);
    fin.points.push_back(Vec3f(0, 0, 20));
    fin.triangles.push_back(
        {fin.triangles[0][0], fin.triangles[0][1], static_cast<VertexId>(fin.points.size() - 1)});
    expect_refused(fin, "1 edges have more than two faces");
    TriMesh turned = icosphere(2, 10);
    std::swap(turned.triangles[5][0], turned.triangles[5][1]);
    expect_refused(turned, "across 3 edges one face is turned over");
    TriMesh pinched = joined(icosphere(1, 1), icosphere(1, 2));
    for (Triangle& t : pinched.triangles)
        for (VertexId& v : t)
            if (v == 0) v = static_cast<VertexId>(pinched.points.size() / 2);
    expect_refused(pinched, "1 vertices have more than one fan");
    TriMesh repeated = icosphere(1, 1);
    repeated.triangles[3][1] = repeated.triangles[3][0];
    expect_refused(repeated, "1 faces name a vertex twice");
    TriMesh twice = icosphere(1, 1);
    twice.triangles.push_back(twice.triangles[0]);
    expect_refused(twice, "3 edges have more than two faces");
}

TEST(Simplify, RefusesBadOptions) {
    EXPECT_THROW(simplify(icosphere(1, 1), {}), InvalidInput);
    EXPECT_THROW(within_distance(icosphere(1, 1), 0), InvalidInput);
    EXPECT_THROW(within_distance(icosphere(1, 1), std::nan("")), InvalidInput);
}

TEST(Simplify, DropsPointsThatNoFaceNames) {
    TriMesh stray = icosphere(3, 10);
    stray.points.insert(stray.points.begin(), Vec3f(99, 99, 99));
    for (Triangle& t : stray.triangles)
        for (VertexId& v : t) ++v;
    const TriMesh fewer = to_faces(stray, 400);
    EXPECT_EQ(fewer.points.size(), 202u);
}

TEST(Simplify, TheSameForAnyNumberOfThreads) {
    const TriMesh torus = torus_mesh(20, 6, 120, 60);
    TriMesh results[2], bounded[2];
    for (std::size_t threads = 1; threads <= 2; ++threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        results[threads - 1] = to_faces(torus, 3000);
        bounded[threads - 1] = within_distance(torus, 0.05);
    }
    EXPECT_TRUE(same_bytes(results[0], results[1]));
    EXPECT_TRUE(same_bytes(bounded[0], bounded[1]));
}

TEST(Simplify, CanBeStopped) {
    const Progress stop([](double) { return false; });
    SimplifyOptions options;
    options.faces = 100;
    EXPECT_THROW(simplify(torus_mesh(20, 6, 300, 150), options, stop), Cancelled);
}
