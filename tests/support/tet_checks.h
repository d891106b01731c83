// What the tests of tetrahedralizers measure, by their own formulas.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "tests/support/meshes.h"
#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::test {

/// The least and the largest dihedral angle, in degrees.
inline std::array<double, 2> dihedral_range(const TetMesh& mesh) {
    std::array<double, 2> range{180, 0};
    for (const Tetrahedron& t : mesh.tets)
        for (std::size_t i = 0; i < 4; ++i)
            for (std::size_t j = i + 1; j < 4; ++j) {
                const std::size_t k = i == 0 ? (j == 1 ? 2 : 1) : 0, l = 6 - i - j - k;
                const Vec3d a = mesh.points[t[i]], axis = (mesh.points[t[j]] - a).normalized();
                Vec3d u = mesh.points[t[k]] - a, v = mesh.points[t[l]] - a;
                u -= axis * axis.dot(u);
                v -= axis * axis.dot(v);
                const double angle = std::atan2(u.cross(v).norm(), u.dot(v)) * 180 / M_PI;
                range = {std::min(range[0], angle), std::max(range[1], angle)};
            }
    return range;
}

/// Circumradius over shortest edge, the largest of all.
inline double largest_radius_edge(const TetMesh& mesh) {
    double largest = 0;
    for (const Tetrahedron& t : mesh.tets) {
        const Vec3d a = mesh.points[t[0]];
        Mat3d m;
        double shortest = 1e300;
        for (int k = 0; k < 3; ++k) m.row(k) = mesh.points[t[std::size_t(k) + 1]] - a;
        for (const auto& [i, j] : tet_edges)
            shortest =
                std::min(shortest, (mesh.points[t[std::size_t(i)]] - mesh.points[t[std::size_t(j)]]).norm());
        const Vec3d centre = m.inverse() * (0.5 * m.rowwise().squaredNorm());
        largest = std::max(largest, centre.norm() / shortest);
    }
    return largest;
}

inline std::map<std::int32_t, double> volumes(const TetMesh& mesh) {
    std::map<std::int32_t, double> sums;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) sums[mesh.region(t)] += tet_determinant(mesh, t) / 6;
    return sums;
}

inline double mean_edge(const TetMesh& mesh) {
    double sum = 0;
    for (const Tetrahedron& t : mesh.tets)
        for (const auto& [i, j] : tet_edges)
            sum += (mesh.points[t[std::size_t(i)]] - mesh.points[t[std::size_t(j)]]).norm();
    return sum / (6 * double(mesh.tets.size()));
}

/// The volume that a closed surface encloses.
inline double enclosed_volume(const TriMesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        sum += mesh.points[t[0]].cast<double>().dot(
            mesh.points[t[1]].cast<double>().cross(mesh.points[t[2]].cast<double>()));
    return sum / 6;
}

/// Faces by their sorted corners, in order.
template <class Faces>
std::vector<Triangle> sorted(const Faces& faces) {
    std::vector<Triangle> all(faces.begin(), faces.end());
    for (Triangle& t : all) std::sort(t.begin(), t.end());
    std::sort(all.begin(), all.end());
    return all;
}

/// Every tetrahedron positive, every face of one or two of them, and those of one the mesh's boundary.
inline void expect_sound(const TetMesh& mesh) {
    EXPECT_NO_THROW(check(mesh, "mesh"));
    std::size_t turned_over = 0;
    std::vector<Triangle> all, once, told;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        turned_over += !(tet_determinant(mesh, t) > 0);
        for (const auto& face : tet_faces) {
            all.emplace_back();
            for (std::size_t k = 0; k < 3; ++k) all.back()[k] = mesh.tets[t][std::size_t(face[k])];
        }
    }
    EXPECT_EQ(turned_over, 0u);
    all = sorted(all);
    for (std::size_t begin = 0, end; begin < all.size(); begin = end) {
        for (end = begin; end < all.size() && all[end] == all[begin];) ++end;
        ASSERT_LE(end - begin, 2u);
        if (end - begin == 1) once.push_back(all[begin]);
    }
    for (std::size_t f = 0; f < mesh.faces.size(); ++f)
        if (mesh.face_regions[f][1] == 0) told.push_back(mesh.faces[f]);
    EXPECT_TRUE(sorted(told) == once);
}

/// The points of the surface come first, bit for bit, and its faces are those between the mesh's regions.
inline void expect_kept(const TetMesh& mesh, const TriMesh& surface) {
    ASSERT_GE(mesh.points.size(), surface.points.size());
    for (std::size_t i = 0; i < surface.points.size(); ++i)
        ASSERT_EQ(mesh.points[i], surface.points[i].cast<double>()) << i;
    std::vector<Triangle> wanted = sorted(surface.triangles);
    wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
    EXPECT_TRUE(sorted(mesh.faces) == wanted);
}

inline bool same_bytes(const TetMesh& a, const TetMesh& b) {
    return a.points == b.points && a.tets == b.tets && a.regions == b.regions && a.faces == b.faces &&
           a.face_regions == b.face_regions;
}

}  // namespace vdbgeo::test
