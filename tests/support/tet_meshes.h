// Tetrahedral meshes of known shape, made in code: lattices, and solids that are cut out of them.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::test {

/// A tetrahedron with positive volume, whichever way its corners were named.
inline Tetrahedron turned_right(const Array<Vec3d>& points, Tetrahedron t) {
    if (tet_determinant(points[t[0]], points[t[1]], points[t[2]], points[t[3]]) < 0) std::swap(t[2], t[3]);
    return t;
}

/// One tetrahedron, with its faces.
inline TetMesh one_tet(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    TetMesh mesh;
    mesh.points = {a, b, c, d};
    mesh.tets = {{0, 1, 2, 3}};
    set_faces(mesh);
    return mesh;
}

inline TetMesh regular_tet() { return one_tet({1, 1, 1}, {-1, 1, -1}, {1, -1, -1}, {-1, -1, 1}); }

/// The box [0, nx h] × [0, ny h] × [0, nz h] as cubes of side h, each cut into six along its diagonal (Kuhn):
/// 6 nx ny nz tetrahedra, angles of 45°, 60° and 90°. No faces are set.
inline TetMesh kuhn_box(int nx, int ny, int nz, double h = 1) {
    TetMesh mesh;
    const auto id = [&](int x, int y, int z) {
        return static_cast<VertexId>((z * (ny + 1) + y) * (nx + 1) + x);
    };
    for (int z = 0; z <= nz; ++z)
        for (int y = 0; y <= ny; ++y)
            for (int x = 0; x <= nx; ++x) mesh.points.emplace_back(x * h, y * h, z * h);
    static constexpr int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    for (int z = 0; z < nz; ++z)
        for (int y = 0; y < ny; ++y)
            for (int x = 0; x < nx; ++x)
                for (int k = 0; k < 6; ++k) {
                    int at[3] = {x, y, z};
                    Tetrahedron t{};
                    t[0] = id(x, y, z);
                    for (std::size_t step = 0; step < 3; ++step) {
                        ++at[orders[k][step]];
                        t[step + 1] = id(at[0], at[1], at[2]);
                    }
                    if (k >= 3) std::swap(t[2], t[3]);  // the odd orders
                    mesh.tets.push_back(t);
                }
    return mesh;
}

/// The body-centred lattice over the same box: the corners and the middles of the cubes; four tetrahedra
/// about each square between two cubes, with angles of 60° and 90°. The box is not filled at its sides. No
/// faces are set.
inline TetMesh bcc_lattice(int nx, int ny, int nz, double h = 1) {
    TetMesh mesh;
    const auto corner = [&](int x, int y, int z) {
        return static_cast<VertexId>((z * (ny + 1) + y) * (nx + 1) + x);
    };
    const auto corners = static_cast<VertexId>((nx + 1) * (ny + 1) * (nz + 1));
    const auto middle = [&](int x, int y, int z) {
        return corners + static_cast<VertexId>((z * ny + y) * nx + x);
    };
    for (int z = 0; z <= nz; ++z)
        for (int y = 0; y <= ny; ++y)
            for (int x = 0; x <= nx; ++x) mesh.points.emplace_back(x * h, y * h, z * h);
    for (int z = 0; z < nz; ++z)
        for (int y = 0; y < ny; ++y)
            for (int x = 0; x < nx; ++x)
                mesh.points.emplace_back((x + 0.5) * h, (y + 0.5) * h, (z + 0.5) * h);
    const int n[3] = {nx, ny, nz};
    for (int z = 0; z < nz; ++z)
        for (int y = 0; y < ny; ++y)
            for (int x = 0; x < nx; ++x)
                for (int axis = 0; axis < 3; ++axis) {
                    int next[3] = {x, y, z};
                    if (++next[axis] == n[axis]) continue;
                    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
                    VertexId ring[4];
                    for (int k = 0; k < 4; ++k) {
                        int at[3] = {next[0], next[1], next[2]};
                        at[u] += k == 1 || k == 2;
                        at[v] += k >= 2;
                        ring[k] = corner(at[0], at[1], at[2]);
                    }
                    const VertexId below = middle(x, y, z), above = middle(next[0], next[1], next[2]);
                    for (int k = 0; k < 4; ++k)
                        mesh.tets.push_back(
                            turned_right(mesh.points, {below, above, ring[k], ring[(k + 1) % 4]}));
                }
    return mesh;
}

/// The tetrahedra that `keep` says, with the points that they use, in the order of the mesh. Faces are set.
template <class Keep>
TetMesh kept_tets(const TetMesh& mesh, const Keep& keep) {
    TetMesh out;
    std::vector<VertexId> number(mesh.points.size(), 0xFFFFFFFFu);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        if (!keep(t)) continue;
        out.tets.push_back(mesh.tets[t]);
        if (!mesh.regions.empty()) out.regions.push_back(mesh.regions[t]);
        for (const VertexId v : mesh.tets[t]) number[v] = 0;
    }
    for (std::size_t v = 0; v < number.size(); ++v) {
        if (number[v] != 0) continue;
        number[v] = static_cast<VertexId>(out.points.size());
        out.points.push_back(mesh.points[v]);
    }
    for (Tetrahedron& t : out.tets)
        for (VertexId& v : t) v = number[v];
    set_faces(out);
    return out;
}

inline Vec3d centroid(const TetMesh& mesh, std::size_t tet) {
    Vec3d sum = Vec3d::Zero();
    for (const VertexId v : mesh.tets[tet]) sum += mesh.points[v];
    return sum / 4;
}

/// A solid, where `field` (a signed distance, positive inside, in Å) is positive, within the cube of half the
/// side `reach` about the origin: a body-centred lattice of step h, its points nearer than h/5 to the surface
/// moved onto it, and the tetrahedra without a point outside. Sound, but its boundary is rough. Faces are
/// set.
inline TetMesh solid_tets(const std::function<double(const Vec3d&)>& field, double reach, double h) {
    const int n = static_cast<int>(std::ceil(2 * reach / h));
    TetMesh mesh = bcc_lattice(n, n, n, h);
    std::vector<bool> outside(mesh.points.size());
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        Vec3d& p = mesh.points[i];
        p -= Vec3d::Constant(0.5 * n * h);
        const double distance = field(p), e = 1e-4 * h;
        if (std::abs(distance) > 0.2 * h) {
            outside[i] = distance < 0;
            continue;
        }
        Vec3d gradient;
        for (int a = 0; a < 3; ++a)
            gradient[a] = (field(p + e * Vec3d::Unit(a)) - field(p - e * Vec3d::Unit(a))) / (2 * e);
        p -= distance * gradient;
    }
    return kept_tets(mesh, [&](std::size_t t) {
        for (const VertexId v : mesh.tets[t])
            if (outside[v]) return false;
        return true;
    });
}

inline TetMesh ball_tets(double radius, double h) {
    return solid_tets([=](const Vec3d& p) { return radius - p.norm(); }, radius + h, h);
}

inline TetMesh torus_tets(double radius, double minor_radius, double h) {
    return solid_tets(
        [=](const Vec3d& p) { return minor_radius - std::hypot(std::hypot(p.x(), p.y()) - radius, p.z()); },
        radius + minor_radius + h, h);
}

/// Moves every point.
template <class Move>
void move_points(TetMesh& mesh, const Move& move) {
    for (Vec3d& p : mesh.points) p = move(p);
}

}  // namespace vdbgeo::test
