#include "vdbgeo/remesh/fill_holes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

constexpr std::size_t exact_edges = 128;
constexpr double ear_bend = 150 * 3.14159265358979323846 / 180;
constexpr double fold = 172 * 3.14159265358979323846 / 180;

/// A side of a hole, in the direction of the faces that will fill it.
struct Side {
    VertexId from, to;
    Vec3d normal;  // of the face across
};
using Loop = std::vector<Side>;

Vec3d point(const TriMesh& mesh, VertexId v) { return mesh.points[v].cast<double>(); }

Vec3d normal_of(const TriMesh& mesh, VertexId a, VertexId b, VertexId c) {
    return (point(mesh, b) - point(mesh, a)).cross(point(mesh, c) - point(mesh, a));
}

/// The angle by which a surface turns from one face to the next: 0 where flat, and where a face has no area.
double bend(const Vec3d& a, const Vec3d& b) {
    const double sine = a.cross(b).norm(), cosine = a.dot(b);
    return sine == 0 && cosine == 0 ? 0 : std::atan2(sine, cosine);
}

/// The sides of all holes by their first vertices.
std::vector<Side> find_sides(const TriMesh& mesh, const VertexFaces& faces) {
    std::vector<Side> sides;
    VertexStar star;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        star.fill(mesh, faces, static_cast<VertexId>(v));
        star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
            if (last - first != 1 || first->out) return;  // the hole's side runs against the face's
            const Triangle& t = mesh.triangles[star.face(first->slot)];
            sides.push_back({static_cast<VertexId>(v), first->other, normal_of(mesh, t[0], t[1], t[2])});
        });
    }
    return sides;
}

/// Walks along the sides and cuts a loop off wherever the way comes back to a vertex, so no loop has a vertex
/// twice. Ways that end are left.
std::vector<Loop> find_loops(const std::vector<Side>& sides) {
    std::vector<Loop> loops;
    std::vector<bool> used(sides.size(), false);
    std::set<VertexId> on_way;
    const auto next = [&](VertexId v) {
        auto it = std::lower_bound(sides.begin(), sides.end(), v,
                                   [](const Side& s, VertexId at) { return s.from < at; });
        while (it != sides.end() && it->from == v && used[std::size_t(it - sides.begin())]) ++it;
        return it != sides.end() && it->from == v ? it : sides.end();
    };
    for (std::size_t start = 0; start < sides.size(); ++start) {
        if (used[start]) continue;
        Loop way;
        VertexId at = sides[start].from;
        for (;;) {
            const auto side = next(at);
            if (side == sides.end()) {
                if (way.empty()) break;
                at = way.back().from;
                on_way.erase(at);
                way.pop_back();
                continue;
            }
            used[std::size_t(side - sides.begin())] = true;
            way.push_back(*side);
            on_way.insert(side->from);
            at = side->to;
            if (!on_way.count(at)) continue;
            auto first = way.end();
            do on_way.erase((--first)->from);
            while (first->from != at);
            loops.emplace_back(first, way.end());
            way.erase(first, way.end());
        }
    }
    return loops;
}

/// The mesh's edges between vertices of a loop.
using Edges = std::set<std::pair<VertexId, VertexId>>;

Edges edges_among(const TriMesh& mesh, const VertexFaces& faces, const Loop& loop) {
    std::set<VertexId> in_loop;
    for (const Side& s : loop) in_loop.insert(s.from);
    Edges edges;
    for (const VertexId v : in_loop)
        for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f)
            for (const VertexId w : mesh.triangles[*f])
                if (w != v && in_loop.count(w)) edges.insert(std::minmax(v, w));
    return edges;
}

/// The best triangulation of a polygon by dynamic programming over its chords.
class LoopTriangulation {
 public:
    LoopTriangulation(const TriMesh& mesh, const Loop& loop, const Edges& edges)
        : mesh_(mesh), loop_(loop), n_(loop.size()), cells_(n_ * n_), allowed_(n_ * n_, true) {
        for (std::size_t i = 0; i < n_; ++i)
            for (std::size_t k = i + 2; k < n_; ++k)
                if (!(i == 0 && k + 1 == n_))
                    allowed_[i * n_ + k] = !edges.count(std::minmax(loop[i].from, loop[k].from));
        for (std::size_t i = 0; i + 1 < n_; ++i) cells_[i * n_ + i + 1].weight = {0, 0};
        for (std::size_t length = 2; length < n_; ++length)
            for (std::size_t i = 0; i + length < n_; ++i) solve(i, i + length);
    }

    /// Nothing where each triangulation uses an edge of the mesh.
    std::vector<Triangle> triangles() const {
        std::vector<Triangle> all;
        if (!std::isfinite(cells_[n_ - 1].weight.first)) return all;
        std::vector<std::pair<std::size_t, std::size_t>> chords = {{0, n_ - 1}};
        while (!chords.empty()) {
            const auto [i, k] = chords.back();
            chords.pop_back();
            if (k - i < 2) continue;
            const std::size_t m = cells_[i * n_ + k].middle;
            all.push_back({loop_[i].from, loop_[m].from, loop_[k].from});
            chords.emplace_back(m, k);
            chords.emplace_back(i, m);
        }
        return all;
    }

 private:
    using Weight = std::pair<double, double>;  // largest bend, area
    struct Cell {
        Weight weight{std::numeric_limits<double>::infinity(), 0};
        std::size_t middle = 0;
        Vec3d normal = Vec3d::Zero();  // of the triangle at the chord
    };

    const Vec3d& normal_across(std::size_t i, std::size_t k) const {
        return k == i + 1 ? loop_[i].normal : cells_[i * n_ + k].normal;
    }

    void solve(std::size_t i, std::size_t k) {
        Cell& cell = cells_[i * n_ + k];
        if (!allowed_[i * n_ + k]) return;
        for (std::size_t m = i + 1; m < k; ++m) {
            const Weight &a = cells_[i * n_ + m].weight, &b = cells_[m * n_ + k].weight;
            if (std::max(a.first, b.first) > cell.weight.first) continue;
            const Vec3d normal = normal_of(mesh_, loop_[i].from, loop_[m].from, loop_[k].from);
            double worst = std::max(
                {a.first, b.first, bend(normal, normal_across(i, m)), bend(normal, normal_across(m, k))});
            if (i == 0 && k + 1 == n_) worst = std::max(worst, bend(normal, loop_[k].normal));
            const Weight weight{worst, a.second + b.second + 0.5 * normal.norm()};
            if (std::isfinite(worst) && weight < cell.weight) cell = {weight, m, normal};
        }
    }

    const TriMesh& mesh_;
    const Loop& loop_;
    std::size_t n_;
    std::vector<Cell> cells_;  // [i, k]: the polygon from vertex i to vertex k
    std::vector<bool> allowed_;
};

/// Whether a point lies in a triangle, both seen along `along`.
bool covers(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p, const Vec3d& along) {
    const auto left = [&](const Vec3d& s, const Vec3d& t) { return (t - s).cross(p - s).dot(along) >= 0; };
    return left(a, b) && left(b, c) && left(c, a);
}

/// Cuts the corner with the shortest chord off a loop, of those that are convex seen along the loop's normal
/// and hold no other vertex. False where there is none.
bool clip_ear(const TriMesh& mesh, Loop& loop, const Edges& edges, const Vec3d& along,
              std::vector<Triangle>& out) {
    const std::size_t n = loop.size();
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t i = 0; i < n; ++i)
        order.emplace_back((point(mesh, loop[(i + 1) % n].to) - point(mesh, loop[i].from)).squaredNorm(), i);
    std::sort(order.begin(), order.end());
    for (const auto& [length, i] : order) {
        const std::size_t next = (i + 1) % n;
        const VertexId a = loop[i].from, b = loop[i].to, c = loop[next].to;
        const Vec3d normal = normal_of(mesh, a, b, c);
        const double turned = std::max(bend(normal, loop[i].normal), bend(normal, loop[next].normal));
        if (normal.dot(along) <= 0 || turned > ear_bend || edges.count(std::minmax(a, c))) continue;
        const bool empty = std::none_of(loop.begin(), loop.end(), [&](const Side& s) {
            return s.from != a && s.from != b && s.from != c &&
                   covers(point(mesh, a), point(mesh, b), point(mesh, c), point(mesh, s.from), along);
        });
        if (!empty) continue;
        out.push_back({a, b, c});
        loop[i] = {a, c, normal};
        loop.erase(loop.begin() + std::ptrdiff_t(next));
        return true;
    }
    return false;
}

Vec3d loop_normal(const TriMesh& mesh, const Loop& loop) {
    Vec3d sum = Vec3d::Zero();
    const Vec3d origin = point(mesh, loop.front().from);
    for (const Side& s : loop) sum += (point(mesh, s.from) - origin).cross(point(mesh, s.to) - origin);
    return sum;
}

VertexId append_mean(TriMesh& mesh, const Loop& loop) {
    if (mesh.points.size() >= TriMesh::max_vertices) throw InvalidInput("holes: more than 2^32-1 vertices");
    const double n = static_cast<double>(loop.size());
    Vec3d sum = Vec3d::Zero();
    for (const Side& s : loop) sum += point(mesh, s.from);
    mesh.points.push_back((sum / n).cast<float>());
    for (MeshProperty& p : mesh.vertex_properties)
        for (int c = 0; c < p.components; ++c) {
            double mean = 0;
            for (const Side& s : loop)
                mean += double(p.values[std::size_t(p.components) * s.from + std::size_t(c)]) / n;
            p.values.push_back(static_cast<float>(mean));
        }
    return static_cast<VertexId>(mesh.points.size() - 1);
}

/// Whether a triangulation turns back onto the faces around the loop, or between its own.
bool folds(const TriMesh& mesh, const Loop& loop, const std::vector<Triangle>& triangles) {
    for (const Triangle& t : triangles)
        for (std::size_t k = 0; k < 3; ++k)
            for (const Side& s : loop)
                if (s.from == t[k] && s.to == t[(k + 1) % 3] &&
                    bend(normal_of(mesh, t[0], t[1], t[2]), s.normal) > fold)
                    return true;
    return false;
}

/// The faces for a loop; nothing where it has to stay open.
std::vector<Triangle> fill(TriMesh& mesh, const VertexFaces& faces, const Loop& loop) {
    const Edges edges = edges_among(mesh, faces, loop);
    std::vector<Triangle> triangles;
    Loop rest = loop;
    const Vec3d along = loop_normal(mesh, loop);
    Edges taken = edges;
    bool clipped = true;
    while (rest.size() > exact_edges && (clipped = clip_ear(mesh, rest, taken, along, triangles)))
        taken.insert(std::minmax(triangles.back()[0], triangles.back()[2]));
    if (clipped) {
        const std::vector<Triangle> last = LoopTriangulation(mesh, rest, taken).triangles();
        triangles.insert(triangles.end(), last.begin(), last.end());
        if (!last.empty()) return folds(mesh, loop, triangles) ? std::vector<Triangle>() : triangles;
    }
    triangles.clear();
    const VertexId middle = append_mean(mesh, loop);
    for (const Side& s : loop) triangles.push_back({s.from, s.to, middle});
    if (!folds(mesh, loop, triangles)) return triangles;
    mesh.points.pop_back();
    for (MeshProperty& p : mesh.vertex_properties)
        p.values.resize(p.values.size() - std::size_t(p.components));
    return {};
}

}  // namespace

FilledHoles fill_holes(TriMesh& mesh, std::uint64_t max_edges, const Progress& progress) {
    const VertexFaces faces(mesh);
    const std::vector<Loop> loops = find_loops(find_sides(mesh, faces));
    const std::size_t points = mesh.points.size();
    FilledHoles counts;
    for (std::size_t i = 0; i < loops.size(); ++i) {
        progress.report(double(i) / double(loops.size()));
        const std::vector<Triangle> added =
            loops[i].size() <= max_edges ? fill(mesh, faces, loops[i]) : std::vector<Triangle>();
        ++(added.empty() ? counts.left_open : counts.filled);
        counts.faces += added.size();
        mesh.triangles.insert(mesh.triangles.end(), added.begin(), added.end());
    }
    for (MeshProperty& p : mesh.face_properties)
        p.values.resize(mesh.triangles.size() * static_cast<std::size_t>(p.components), 0.0f);
    counts.vertices = mesh.points.size() - points;
    progress.report(1);
    return counts;
}

}  // namespace vdbgeo
