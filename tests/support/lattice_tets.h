// Tetrahedral meshes of implicit solids made on a body-centred cubic lattice, with the poor angles at the
// surface that isosurface stuffing leaves.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::test {

/// Above 0 inside.
using Implicit = std::function<double(const Vec3d&)>;

/// Serial isosurface stuffing without grading: the lattice's vertices near the surface are snapped to it,
/// what it still cuts is cut. Prisms are cut from their vertices with the least numbers, so the angles are
/// worse than by the published stencils.
class LatticeTets {
 public:
    /// Cubes of side h in the box from −extent to extent along each axis.
    LatticeTets(Implicit inside, double extent, double h)
        : inside_(std::move(inside)), n_(int(std::ceil(extent / h)) + 1), h_(h) {}

    TetMesh make() {
        const int m = 2 * n_ + 1;
        count_ = m;
        for (int kind = 0; kind < 2; ++kind)
            for (int z = 0; z < m; ++z)
                for (int y = 0; y < m; ++y)
                    for (int x = 0; x < m; ++x)
                        lattice_.push_back(h_ * (Vec3d(x, y, z) - Vec3d::Constant(n_ - 0.5 * kind)));
        for (const Vec3d& p : lattice_) value_.push_back(inside_(p));
        std::vector<std::array<int, 4>> all = lattice_tets();
        snap(all);
        for (const auto& t : all) cut(t);
        set_faces(mesh_);
        return std::move(mesh_);
    }

 private:
    int id(int kind, int x, int y, int z) const { return ((kind * count_ + z) * count_ + y) * count_ + x; }

    /// Four around each axis-parallel edge between two centres, by the sides of the cubes' shared face.
    std::vector<std::array<int, 4>> lattice_tets() const {
        std::vector<std::array<int, 4>> all;
        for (int z = 1; z + 1 < count_; ++z)
            for (int y = 1; y + 1 < count_; ++y)
                for (int x = 1; x + 1 < count_; ++x)
                    for (int a = 0; a < 3; ++a) {
                        std::array<int, 3> before{x, y, z};  // the centres (x, y, z) + ½ and one back along a
                        --before[std::size_t(a)];
                        const int c = id(1, x, y, z), d = id(1, before[0], before[1], before[2]);
                        const int b = (a + 1) % 3, e = (a + 2) % 3;
                        constexpr int around[5][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
                        std::array<int, 5> corners{};
                        for (std::size_t k = 0; k < 5; ++k) {
                            std::array<int, 3> p{x, y, z};
                            p[std::size_t(b)] += around[k][0], p[std::size_t(e)] += around[k][1];
                            corners[k] = id(0, p[0], p[1], p[2]);
                        }
                        for (std::size_t k = 0; k < 4; ++k) all.push_back({c, d, corners[k], corners[k + 1]});
                    }
        return all;
    }

    Vec3d crossing(int a, int b) const {
        Vec3d p = lattice_[std::size_t(a)], q = lattice_[std::size_t(b)];
        const bool sign = value_[std::size_t(a)] > 0;
        for (int i = 0; i < 60; ++i) {
            const Vec3d middle = 0.5 * (p + q);
            ((inside_(middle) > 0) == sign ? p : q) = middle;
        }
        return 0.5 * (p + q);
    }

    void snap(const std::vector<std::array<int, 4>>& all) {
        std::map<std::pair<int, int>, Vec3d> cuts;
        std::map<int, std::vector<int>> neighbours;
        for (const auto& t : all)
            for (const auto& [i, j] : tet_edges) {
                const int a = std::min(t[std::size_t(i)], t[std::size_t(j)]),
                          b = std::max(t[std::size_t(i)], t[std::size_t(j)]);
                if (value_[std::size_t(a)] * value_[std::size_t(b)] >= 0) continue;
                if (!cuts.emplace(std::make_pair(a, b), Vec3d::Zero()).second) continue;
                cuts[{a, b}] = crossing(a, b);
                neighbours[a].push_back(b);
                neighbours[b].push_back(a);
            }
        const std::vector<Vec3d> original = lattice_;
        for (const auto& [v, around] : neighbours) {
            double nearest = 1;
            for (const int w : around) {
                if (value_[std::size_t(w)] == 0) continue;
                const Vec3d& c = cuts[{std::min(v, w), std::max(v, w)}];
                const double edge = (original[std::size_t(w)] - original[std::size_t(v)]).norm(),
                             t = (c - original[std::size_t(v)]).norm() / edge;
                if (t < (edge > 0.95 * h_ ? 0.24999 : 0.41189) && t * edge < nearest * h_)
                    nearest = t * edge / h_, lattice_[std::size_t(v)] = c;
            }
            if (nearest < 1) value_[std::size_t(v)] = 0;
        }
        for (const auto& [edge, c] : cuts)
            if (value_[std::size_t(edge.first)] * value_[std::size_t(edge.second)] < 0) cuts_[edge] = c;
    }

    VertexId vertex(int a) { return number({a, a}, lattice_[std::size_t(a)]); }
    VertexId vertex(int a, int b) {  // where the surface cuts the edge; a itself where it is on the surface
        if (value_[std::size_t(a)] == 0) return vertex(a);
        const std::pair<int, int> edge{std::min(a, b), std::max(a, b)};
        return number(edge, cuts_.at(edge));
    }
    VertexId number(const std::pair<int, int>& key, const Vec3d& p) {
        const auto [it, fresh] = numbers_.emplace(key, VertexId(mesh_.points.size()));
        if (fresh) mesh_.points.push_back(p);
        return it->second;
    }

    void cut(const std::array<int, 4>& t) {
        std::vector<int> in, out;
        bool any = false;
        for (const int v : t) {
            (value_[std::size_t(v)] < 0 ? out : in).push_back(v);
            any = any || value_[std::size_t(v)] > 0;
        }
        if (!any) return;
        std::stable_sort(in.begin(), in.end(), [&](int a, int b) {
            return value_[std::size_t(a)] > 0 && !(value_[std::size_t(b)] > 0);
        });
        if (out.empty()) add(vertex(t[0]), vertex(t[1]), vertex(t[2]), vertex(t[3]));
        if (out.size() == 1)
            prism({vertex(in[0]), vertex(in[1]), vertex(in[2])},
                  {vertex(in[0], out[0]), vertex(in[1], out[0]), vertex(in[2], out[0])});
        if (out.size() == 2)
            prism({vertex(in[0]), vertex(in[0], out[0]), vertex(in[0], out[1])},
                  {vertex(in[1]), vertex(in[1], out[0]), vertex(in[1], out[1])});
        if (out.size() == 3)
            add(vertex(in[0]), vertex(in[0], out[0]), vertex(in[0], out[1]), vertex(in[0], out[2]));
    }

    void prism(std::array<VertexId, 3> a, std::array<VertexId, 3> b) {
        if (*std::min_element(b.begin(), b.end()) < *std::min_element(a.begin(), a.end())) std::swap(a, b);
        const auto turn = std::min_element(a.begin(), a.end()) - a.begin();
        std::rotate(a.begin(), a.begin() + turn, a.end());
        std::rotate(b.begin(), b.begin() + turn, b.end());
        add(a[0], b[0], b[1], b[2]);
        if (std::min(a[1], b[2]) < std::min(a[2], b[1])) {
            add(a[0], a[1], a[2], b[2]);
            add(a[0], a[1], b[2], b[1]);
        } else {
            add(a[0], a[1], a[2], b[1]);
            add(a[0], a[2], b[2], b[1]);
        }
    }

    void add(VertexId a, VertexId b, VertexId c, VertexId d) {
        if (a == b || a == c || a == d || b == c || b == d || c == d) return;
        if (tet_determinant(mesh_.points[a], mesh_.points[b], mesh_.points[c], mesh_.points[d]) < 0)
            std::swap(c, d);
        mesh_.tets.push_back({a, b, c, d});
    }

    Implicit inside_;
    int n_, count_ = 0;
    double h_;
    std::vector<Vec3d> lattice_;
    std::vector<double> value_;
    std::map<std::pair<int, int>, Vec3d> cuts_;
    std::map<std::pair<int, int>, VertexId> numbers_;
    TetMesh mesh_;
};

inline TetMesh lattice_tets(const Implicit& inside, double extent, double h) {
    return LatticeTets(inside, extent, h).make();
}

}  // namespace vdbgeo::test
