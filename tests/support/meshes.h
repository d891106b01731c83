// Small meshes of known shape, made in code, with normals outwards.
#pragma once

#include <Eigen/Geometry>

#include <cmath>
#include <map>
#include <utility>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::test {

/// A sphere about the origin: an icosahedron whose faces are split into four `subdivisions` times.
inline TriMesh icosphere(int subdivisions, double radius) {
    const double g = (1 + std::sqrt(5.0)) / 2;
    std::vector<Vec3d> points = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                                 {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    Array<Triangle> faces = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                             {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                             {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                             {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    for (Vec3d& p : points) p.normalize();
    for (int s = 0; s < subdivisions; ++s) {
        std::map<std::pair<VertexId, VertexId>, VertexId> middles;
        const auto middle = [&](VertexId a, VertexId b) {
            const auto [it, fresh] =
                middles.try_emplace(std::minmax(a, b), static_cast<VertexId>(points.size()));
            if (fresh) points.push_back((points[a] + points[b]).normalized());
            return it->second;
        };
        Array<Triangle> finer;
        for (const Triangle& t : faces) {
            const VertexId ab = middle(t[0], t[1]), bc = middle(t[1], t[2]), ca = middle(t[2], t[0]);
            for (const Triangle& part : {Triangle{t[0], ab, ca}, Triangle{t[1], bc, ab},
                                         Triangle{t[2], ca, bc}, Triangle{ab, bc, ca}})
                finer.push_back(part);
        }
        faces = finer;
    }
    TriMesh mesh;
    for (const Vec3d& p : points) mesh.points.push_back((radius * p).cast<float>());
    mesh.triangles = faces;
    return mesh;
}

/// A rows × columns patch of quads split in two, closed round in the columns, and in the rows where asked.
/// point(row, column) gives the corners.
template <class Point>
TriMesh ring_mesh(int rows, int columns, bool closed_rows, const Point& point) {
    TriMesh mesh;
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) mesh.points.push_back(Vec3d(point(r, c)).template cast<float>());
    for (int r = 0; r + (closed_rows ? 0 : 1) < rows; ++r)
        for (int c = 0; c < columns; ++c) {
            const auto id = [&](int row, int column) {
                return static_cast<VertexId>(row % rows * columns + column % columns);
            };
            mesh.triangles.push_back({id(r, c), id(r, c + 1), id(r + 1, c + 1)});
            mesh.triangles.push_back({id(r, c), id(r + 1, c + 1), id(r + 1, c)});
        }
    return mesh;
}

/// A torus about z: circle of radius `ring`, tube of radius `tube`.
inline TriMesh torus_mesh(double ring, double tube, int around_ring = 96, int around_tube = 48) {
    return ring_mesh(around_tube, around_ring, true, [=](int r, int c) {
        const double v = 2 * M_PI * r / around_tube, u = 2 * M_PI * c / around_ring;
        const double far = ring + tube * std::cos(v);
        return Vec3d(far * std::cos(u), far * std::sin(u), tube * std::sin(v));
    });
}

/// A cylinder about z from −height/2 to height/2 without lids.
inline TriMesh open_cylinder_mesh(double radius, double height, int rows = 24, int around = 96) {
    return ring_mesh(rows + 1, around, false, [=](int r, int c) {
        const double u = 2 * M_PI * c / around;
        return Vec3d(radius * std::cos(u), radius * std::sin(u), height * (double(r) / rows - 0.5));
    });
}

/// The same mesh with all faces turned over.
inline TriMesh flipped(TriMesh mesh) {
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    return mesh;
}

/// The mesh moved by p → turn · p + shift.
inline TriMesh moved(TriMesh mesh, const Mat3d& turn, const Vec3d& shift = Vec3d::Zero()) {
    for (Vec3f& p : mesh.points) p = (turn * p.cast<double>() + shift).cast<float>();
    return mesh;
}

/// Both meshes in one; properties are dropped.
inline TriMesh joined(const TriMesh& a, const TriMesh& b) {
    TriMesh mesh;
    mesh.points = a.points;
    mesh.triangles = a.triangles;
    const VertexId first = static_cast<VertexId>(a.points.size());
    mesh.points.insert(mesh.points.end(), b.points.begin(), b.points.end());
    for (const Triangle& t : b.triangles)
        mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    return mesh;
}

}  // namespace vdbgeo::test
