// Meshes of a few faces with known defects.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "tests/support/meshes.h"

namespace vdbgeo::test {

inline TriMesh mesh_of(const std::vector<Vec3f>& points, const std::vector<Triangle>& triangles) {
    TriMesh mesh;
    mesh.points.assign(points.begin(), points.end());
    mesh.triangles.assign(triangles.begin(), triangles.end());
    return mesh;
}

inline TriMesh tetrahedron() {
    return mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                   {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}});
}

/// Corner number: bit 0 x, bit 1 y, bit 2 z.
inline TriMesh cube(const Vec3f& corner = {0, 0, 0}, float edge = 1) {
    std::vector<Vec3f> points;
    for (int i = 0; i < 8; ++i)
        points.push_back(corner + edge * Vec3f(float(i & 1), float(i >> 1 & 1), float(i >> 2 & 1)));
    return mesh_of(points, {{0, 2, 3},
                            {0, 3, 1},
                            {4, 5, 7},
                            {4, 7, 6},
                            {0, 1, 5},
                            {0, 5, 4},
                            {2, 6, 7},
                            {2, 7, 3},
                            {0, 4, 6},
                            {0, 6, 2},
                            {1, 3, 7},
                            {1, 7, 5}});
}

/// Two meshes with vertices of the second put in place of those of the first.
inline TriMesh glued(const TriMesh& a, const TriMesh& b,
                     const std::vector<std::pair<VertexId, VertexId>>& pairs) {
    TriMesh mesh = joined(a, b);
    for (Triangle& t : mesh.triangles)
        for (VertexId& v : t)
            for (const auto& [in_a, in_b] : pairs)
                if (v == a.points.size() + in_b) v = in_a;
    return mesh;
}

inline TriMesh two_cubes_sharing_an_edge() { return glued(cube(), cube({1, 1, 0}), {{3, 0}, {7, 4}}); }
inline TriMesh two_cubes_sharing_a_vertex() { return glued(cube(), cube({1, 1, 1}), {{7, 0}}); }

/// The faces between full and empty unit cells of a block of cells, two triangles each, with shared corners.
template <class Full>
TriMesh cells_mesh(int n, const Full& full) {
    TriMesh mesh;
    const auto id = [&](const Vec3i& p) { return VertexId((p.z() * (n + 1) + p.y()) * (n + 1) + p.x()); };
    for (int z = 0; z <= n; ++z)
        for (int y = 0; y <= n; ++y)
            for (int x = 0; x <= n; ++x) mesh.points.emplace_back(float(x), float(y), float(z));
    const auto is_full = [&](const Vec3i& c) {
        return (c.array() >= 0).all() && (c.array() < n).all() && full(c.x(), c.y(), c.z());
    };
    for (int z = 0; z < n; ++z)
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x)
                for (int axis = 0; axis < 3; ++axis)
                    for (const int side : {0, 1}) {
                        const Vec3i c(x, y, z), step = Vec3i::Unit(axis);
                        if (!is_full(c) || is_full(c + (side ? step : Vec3i(-step)))) continue;
                        Vec3i u = Vec3i::Unit((axis + 1) % 3), v = Vec3i::Unit((axis + 2) % 3);
                        if (!side) std::swap(u, v);
                        const Vec3i o = c + side * step;
                        mesh.triangles.push_back({id(o), id(o + u), id(o + u + v)});
                        mesh.triangles.push_back({id(o), id(o + u + v), id(o + v)});
                    }
    return mesh;
}

}  // namespace vdbgeo::test
