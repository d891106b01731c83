// Isosurface stuffing on a small uniform lattice, the plain way: serial, everything in maps, bisection for
// roots. It shares no code with the library's.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo::test {

class StuffingOracle {
 public:
    using Point = std::array<int, 3>;      // twice the lattice's coordinates: all even or all odd
    using Edge = std::pair<Point, Point>;  // the smaller first; {p, p} stands for a point of the lattice
    using Tet = std::array<Edge, 4>;

    /// Where the field is 0 between a point inside and one outside.
    using Root = std::function<double(const Vec3d& in, const Vec3d& out)>;

    /// f is above or equal 0 inside; the lattice runs from `low` to `high` (in cells). Without `root`:
    /// bisection.
    StuffingOracle(std::function<double(const Vec3d&)> f, Root root, int low, int high, double alpha_long,
                   double alpha_short)
        : f_(std::move(f)),
          root_(std::move(root)),
          low_(2 * low),
          high_(2 * high),
          alpha_{alpha_long, alpha_short} {
        for_each_point([&](const Point& p) { inside_[p] = f_(place(p)) >= 0; });
        find_cuts();
        choose_snaps();
        for_each_point([&](const Point& p) { cells_at(p); });
    }

    const std::vector<Tet>& tets() const { return tets_; }
    Vec3d position(const Edge& v) const {
        if (v.first != v.second) return place(v.first) + cuts_.at(v) * (place(v.second) - place(v.first));
        const auto snap = snaps_.find(v.first);
        return snap == snaps_.end() ? place(v.first) : snap->second;
    }

 private:
    static Vec3d place(const Point& p) { return 0.5 * Vec3d(p[0], p[1], p[2]); }
    static Point plus(const Point& p, const Point& q) { return {p[0] + q[0], p[1] + q[1], p[2] + q[2]}; }
    static Edge edge(const Point& p, const Point& q) { return {std::min(p, q), std::max(p, q)}; }
    static bool is_long(const Point& p, const Point& q) { return (p[0] - q[0]) % 2 == 0; }

    template <class F>
    void for_each_point(const F& f) const {
        for (int x = low_; x <= high_; ++x)
            for (int y = low_; y <= high_; ++y)
                for (int z = low_; z <= high_; ++z)
                    if ((x - y) % 2 == 0 && (y - z) % 2 == 0) f(Point{x, y, z});
    }
    static std::vector<Point> steps() {
        std::vector<Point> out;
        for (int a = 0; a < 3; ++a)
            for (const int s : {2, -2}) {
                Point p{};
                p[static_cast<std::size_t>(a)] = s;
                out.push_back(p);
            }
        for (const int x : {1, -1})
            for (const int y : {1, -1})
                for (const int z : {1, -1}) out.push_back({x, y, z});
        return out;
    }

    void find_cuts() {
        for (const auto& [p, in] : inside_)
            for (const Point& s : steps()) {
                const Point q = plus(p, s);
                const auto other = inside_.find(q);
                if (other == inside_.end() || other->second == in || !(p < q)) continue;
                if (root_) {
                    cuts_[{p, q}] = in ? root_(place(p), place(q)) : 1 - root_(place(q), place(p));
                    continue;
                }
                double a = 0, b = 1;  // the sign at a is that of p
                for (int k = 0; k < 60; ++k) {
                    const double t = 0.5 * (a + b);
                    ((f_(place(p) + t * (place(q) - place(p))) >= 0) == in ? a : b) = t;
                }
                cuts_[{p, q}] = 0.5 * (a + b);
            }
    }

    /// The part of the way from p to the cut point, or 2 where there is none too near.
    double too_near(const Point& p, const Point& q) const {
        const auto cut = cuts_.find(edge(p, q));
        if (cut == cuts_.end()) return 2;
        const double part = p < q ? cut->second : 1 - cut->second;
        return part < alpha_[is_long(p, q) ? 0 : 1] ? part : 2;
    }

    void choose_snaps() {
        std::set<Point> open, snapped;
        for (const auto& c : cuts_) open.insert(c.first.first), open.insert(c.first.second);
        for (bool changed = true; changed;) {
            changed = false;
            for (auto p = open.begin(); p != open.end();) {
                bool kept_near = false, open_near = false;
                for (const Point& s : steps()) {
                    const Point q = plus(*p, s);
                    if (too_near(*p, q) > 1) continue;
                    if (open.count(q))
                        open_near = true;
                    else if (!snapped.count(q))
                        kept_near = true;
                }
                if (kept_near || !open_near) {
                    if (kept_near) snapped.insert(*p);
                    p = open.erase(p);
                    changed = true;
                } else {
                    ++p;
                }
            }
        }
        for (const Point& p : open)
            if (inside_.at(p)) snapped.insert(p);
        for (const Point& p : snapped) {
            double nearest = 2;
            for (const Point& s : steps()) {
                const Point q = plus(p, s);
                const double part = too_near(p, q), distance = part * place(s).norm();
                if (part > 1 || snapped.count(q) || distance >= nearest) continue;
                nearest = distance;
                snaps_[p] = place(p) + part * place(s);
            }
        }
    }

    int sign(const Point& p) const { return snaps_.count(p) ? 0 : inside_.at(p) ? 1 : -1; }

    /// The tetrahedra between a centre and the next one up each axis.
    void cells_at(const Point& c) {
        if (c[0] % 2 == 0) return;
        for (std::size_t m = 0; m < 3; ++m) {
            const std::size_t n = (m + 1) % 3, o = (m + 2) % 3;
            Point d = c;
            d[m] += 2;
            if (!inside_.count(d)) continue;
            const int ring[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
            for (std::size_t k = 0; k < 4; ++k) {
                Point a = c, b = c;
                ++a[m], a[n] += ring[k][0], a[o] += ring[k][1];
                ++b[m], b[n] += ring[(k + 1) % 4][0], b[o] += ring[(k + 1) % 4][1];
                if (inside_.count(a) && inside_.count(b)) cut({a, b, c, d});
            }
        }
    }

    /// Of a face with p, q inside and m outside: whether the diagonal runs from p to the cut point of qm.
    bool from(const Point& p, const Point& q, const Point& m) const {
        if (is_long(p, q)) {
            int larger = 0;
            for (std::size_t a = 0; a < 3; ++a) larger += p[a] > m[a];
            return larger % 2 == 0;
        }
        const Point& partner = is_long(q, m) ? q : p;  // of m on the long edge
        const Vec3d at = position(edge(partner, m));
        const bool far = (at - place(partner)).norm() > (at - place(m)).norm();
        return (partner == q) != far;
    }

    void cut(const std::array<Point, 4>& t) {
        std::vector<Point> in, out, zero;
        for (const Point& p : t) (sign(p) > 0 ? in : sign(p) < 0 ? out : zero).push_back(p);
        const auto self = [](const Point& p) { return Edge{p, p}; };
        if (in.empty()) return;
        if (out.empty() || in.size() == 1) {
            Tet tet;
            for (std::size_t k = 0; k < 4; ++k) tet[k] = sign(t[k]) < 0 ? edge(in[0], t[k]) : self(t[k]);
            tets_.push_back(tet);
            return;
        }
        using Triangle = std::array<Edge, 3>;
        std::vector<Triangle> faces;
        const auto quad = [&](const Edge& a, const Edge& b, const Edge& c, const Edge& d, bool ac) {
            if (ac)
                faces.push_back({a, b, c}), faces.push_back({a, c, d});
            else
                faces.push_back({b, c, d}), faces.push_back({b, d, a});
        };
        const auto side = [&](const Point& p, const Point& q, const Point& m) {
            quad(self(p), self(q), edge(q, m), edge(p, m), from(p, q, m));
        };
        if (in.size() == 3) {
            side(in[0], in[1], out[0]), side(in[1], in[2], out[0]), side(in[2], in[0], out[0]);
            faces.push_back({self(in[0]), self(in[1]), self(in[2])});
            faces.push_back({edge(in[0], out[0]), edge(in[1], out[0]), edge(in[2], out[0])});
            cone(faces);
        } else if (out.size() == 1) {
            side(in[0], in[1], out[0]);
            for (const Triangle& f : faces) tets_.push_back({f[0], f[1], f[2], self(zero[0])});
        } else {
            side(in[0], in[1], out[0]), side(in[0], in[1], out[1]);
            for (const Point& p : in) faces.push_back({self(p), edge(p, out[0]), edge(p, out[1])});
            const auto before = faces;
            for (const bool first : {true, false}) {
                faces = before;
                quad(edge(in[0], out[0]), edge(in[0], out[1]), edge(in[1], out[1]), edge(in[1], out[0]),
                     first);
                if (cone(faces)) return;
            }
        }
    }

    /// A prism is the cone from a corner where two of its three diagonals end.
    bool cone(const std::vector<std::array<Edge, 3>>& faces) {
        std::map<Edge, int> uses;
        for (const auto& f : faces)
            for (const Edge& v : f) ++uses[v];
        for (const auto& [apex, count] : uses) {
            if (count != 5) continue;
            for (const auto& f : faces)
                if (std::find(f.begin(), f.end(), apex) == f.end()) tets_.push_back({f[0], f[1], f[2], apex});
            return true;
        }
        return false;
    }

    std::function<double(const Vec3d&)> f_;
    Root root_;
    int low_, high_;
    std::array<double, 2> alpha_;
    std::map<Point, bool> inside_;
    std::map<Edge, double> cuts_;
    std::map<Point, Vec3d> snaps_;
    std::vector<Tet> tets_;
};

}  // namespace vdbgeo::test
