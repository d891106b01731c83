#include "vdbgeo/remesh/angle_polish.h"

#include <utility>

namespace vdbgeo {
namespace {

using Landing = RemeshState::Landing;
using Kind = InputSurface::Kind;
using VertexHandle = OpenMesh::VertexHandle;
using HalfedgeHandle = OpenMesh::HalfedgeHandle;
using EdgeHandle = OpenMesh::EdgeHandle;
using FaceHandle = OpenMesh::FaceHandle;

/// The sides that the faces around a vertex have opposite of it, and which way those faces look.
struct Fan {
    std::vector<std::pair<Vec3d, Vec3d>> sides;
    Vec3d normal = Vec3d::Zero();
    double side_cosine = 1;  ///< of the face that is turned most from the normal

    void add(const Vec3d& centre, const Vec3d& p, const Vec3d& q) {
        sides.emplace_back(p, q);
        normal += area_vector(centre, p, q);
    }
};

/// What a place for a fan's centre is worth: the cosine of the least angle, the less the better; 1 where a
/// face would turn over.
double cost(const Fan& fan, const Vec3d& centre) {
    double worst = -1;
    for (const auto& [p, q] : fan.sides) {
        const Vec3d n = area_vector(centre, p, q);
        if (n.dot(fan.normal) <= fan.side_cosine * n.norm()) return 1;
        worst = std::max(worst, least_angle_cosine(centre, p, q));
    }
    return worst;
}

class Polish {
 public:
    Polish(RemeshState& state, double least_deg) : state_(state), goal_(std::cos(least_deg * M_PI / 180)) {}

    /// Works on every face worse than the goal once; how many changes that took. Dust is split in the first
    /// pass alone, and left after three: there may be a million pieces of it, and most can be made no better.
    std::size_t pass(int number) {
        pass_ = number;
        std::vector<std::pair<double, int>> bad;
        for (int f = 0; f < static_cast<int>(mesh().n_faces()); ++f)
            if (const double c = cosine(FaceHandle(f)); c > goal_ && (number < 3 || !is_dust(FaceHandle(f))))
                bad.emplace_back(-c, f);
        std::sort(bad.begin(), bad.end());
        std::size_t changes = 0;
        for (const auto& entry : bad)
            if (cosine(FaceHandle(entry.second)) > goal_) changes += improve(FaceHandle(entry.second));
        return changes;
    }

 private:
    /// What a change does: the cosine of the least angle of the faces it touches, before and after.
    struct Change {
        enum { nothing, move, flip, collapse, split } what = nothing;
        HalfedgeHandle edge;
        VertexHandle vertex;
        Landing at = {};
        double after = 1;
    };

    HalfEdgeMesh& mesh() { return state_.mesh(); }
    const Vec3d& point(VertexHandle v) { return state_.point(v); }
    double cosine(FaceHandle f) {
        if (mesh().status(f).deleted()) return -1;
        const HalfedgeHandle h = mesh().halfedge_handle(f);
        return least_angle_cosine(point(mesh().from_vertex_handle(h)), point(mesh().to_vertex_handle(h)),
                                  apex(h));
    }
    bool is_dust(FaceHandle f) {
        return state_.site(mesh().to_vertex_handle(mesh().halfedge_handle(f))).dust;
    }
    const Vec3d& apex(HalfedgeHandle h) {
        return point(mesh().to_vertex_handle(mesh().next_halfedge_handle(h)));
    }

    /// Adds the faces around v, but not those at `other`.
    void add_fan(VertexHandle v, VertexHandle other, Fan& fan) {
        for (auto it = mesh().cvoh_iter(v); it.is_valid(); ++it) {
            if (mesh().is_boundary(*it)) continue;
            const VertexHandle p = mesh().to_vertex_handle(*it),
                               q = mesh().to_vertex_handle(mesh().next_halfedge_handle(*it));
            if (p != other && q != other) fan.add(point(v), point(p), point(q));
        }
    }
    double fan_cosine(VertexHandle v) {
        double worst = -1;
        for (auto it = mesh().cvf_iter(v); it.is_valid(); ++it) worst = std::max(worst, cosine(*it));
        return worst;
    }
    /// Faces may lean as far from the mean normal as they do, or 72°.
    void allow_lean(Fan& fan, const Vec3d& centre) {
        const double length = fan.normal.norm();
        double least = 0.3;
        for (const auto& [p, q] : fan.sides) {
            const Vec3d n = area_vector(centre, p, q);
            const double scale = n.norm() * length;
            if (scale > 0) least = std::min(least, n.dot(fan.normal) / scale);
        }
        fan.side_cosine = std::max(least, 0.05) * length;
    }

    /// Pattern search on the input for the best place of a fan's centre; `cosine` is what it starts from.
    void search(const Fan& fan, Landing& at, double& cosine) {
        if (at.site.kind == Kind::corner) return;
        const Vec3d n = fan.normal.normalized();
        const Vec3d u = n.unitOrthogonal(), v = n.cross(u);
        double step = 0.25 * at.site.length;
        for (int tries = 0; tries < 20 && step > 0.01 * at.site.length && cosine > goal_; ++tries) {
            Landing best = at;
            double best_cosine = cosine;
            for (int k = 0; k < 6; ++k) {
                const double angle = (k + 0.5 * (tries % 2)) * M_PI / 3;
                const Landing there =
                    state_.land(at.point + step * (std::cos(angle) * u + std::sin(angle) * v), at.site);
                if ((there.point - at.point).norm() > 2 * step) continue;
                if (const double c = cost(fan, there.point); c < best_cosine) best = there, best_cosine = c;
            }
            if (best_cosine < cosine)
                at = best, cosine = best_cosine;
            else
                step *= 0.5;
        }
    }

    static void keep_better(const Change& change, double before, Change& best) {
        if (change.after < before - 1e-4 && change.after < best.after) best = change;
    }

    void try_move(VertexHandle v, Change& best) {
        Change change{Change::move, HalfedgeHandle(), v, {point(v), state_.site(v)}, 1};
        if (change.at.site.kind == Kind::corner) return;
        Fan fan;
        add_fan(v, VertexHandle(), fan);
        allow_lean(fan, point(v));
        const double before = fan_cosine(v);
        change.after = before;
        search(fan, change.at, change.after);
        keep_better(change, before, best);
    }
    void try_flip(HalfedgeHandle h, Change& best) {
        const EdgeHandle e = mesh().edge_handle(h);
        if (mesh().is_boundary(e) || !state_.can_flip(e) || !state_.flip_keeps_side(e)) return;
        const HalfedgeHandle o = mesh().opposite_halfedge_handle(h);
        const Vec3d &a = point(mesh().from_vertex_handle(h)), &b = point(mesh().to_vertex_handle(h)),
                    &c = apex(h), &d = apex(o);
        if (mesh().valence(mesh().from_vertex_handle(h)) <= 3 ||
            mesh().valence(mesh().to_vertex_handle(h)) <= 3)
            return;
        const double before = std::max(least_angle_cosine(a, b, c), least_angle_cosine(b, a, d));
        keep_better({Change::flip, h, VertexHandle(), Landing{},
                     std::max(least_angle_cosine(c, d, b), least_angle_cosine(d, c, a))},
                    before, best);
    }
    void try_collapse(HalfedgeHandle h, Change& best) {
        if (state_.site(mesh().from_vertex_handle(h)).kind > state_.site(mesh().to_vertex_handle(h)).kind)
            h = mesh().opposite_halfedge_handle(h);
        if (!state_.can_collapse(h)) return;
        const VertexHandle gone = mesh().from_vertex_handle(h), kept = mesh().to_vertex_handle(h);
        Fan fan;
        add_fan(gone, kept, fan);
        add_fan(kept, gone, fan);
        const double before = std::max(fan_cosine(gone), fan_cosine(kept));
        fan.side_cosine = 0.3 * fan.normal.norm();
        Change change{Change::collapse, h, kept, state_.collapse_landing(h), 1};
        change.after = cost(fan, change.at.point);
        if (change.after < 1) search(fan, change.at, change.after);
        keep_better(change, before, best);
    }
    void try_split(HalfedgeHandle h, Change& best) {
        const HalfedgeHandle o = mesh().opposite_halfedge_handle(h);
        Change change{Change::split, h, VertexHandle(), state_.split_landing(mesh().edge_handle(h)), 1};
        Fan fan;
        double before = -1;
        for (const HalfedgeHandle side : {h, o}) {
            if (mesh().is_boundary(side)) continue;
            const HalfedgeHandle next = mesh().next_halfedge_handle(side),
                                 last = mesh().next_halfedge_handle(next);
            for (const HalfedgeHandle outer : {next, last})
                fan.add(change.at.point, point(mesh().from_vertex_handle(outer)),
                        point(mesh().to_vertex_handle(outer)));
            before = std::max(before, cosine(mesh().face_handle(side)));
        }
        fan.side_cosine = 0.3 * fan.normal.norm();
        change.after = cost(fan, change.at.point);
        if (change.after < 1) search(fan, change.at, change.after);
        keep_better(change, before, best);
    }

    /// The cheap changes first; whatever reaches the goal will do.
    bool improve(FaceHandle f) {
        Change best;
        const HalfedgeHandle first = mesh().halfedge_handle(f);
        const HalfedgeHandle second = mesh().next_halfedge_handle(first);
        const HalfedgeHandle sides[] = {first, second, mesh().next_halfedge_handle(second)};
        for (const HalfedgeHandle h : sides) try_flip(h, best);
        for (const HalfedgeHandle h : sides)
            if (best.after > goal_) try_move(mesh().to_vertex_handle(h), best);
        for (const HalfedgeHandle h : sides)
            if (best.after > goal_) try_collapse(h, best);
        for (const HalfedgeHandle h : sides)
            if (best.after > goal_ && (pass_ == 0 || !is_dust(f))) try_split(h, best);
        return apply(best);
    }
    bool apply(const Change& change) {
        switch (change.what) {
            case Change::nothing:
                return false;
            case Change::move:
                mesh().set_point(change.vertex, change.at.point);
                state_.site(change.vertex) = change.at.site;
                break;
            case Change::flip:
                mesh().flip(mesh().edge_handle(change.edge));
                break;
            case Change::collapse:
                state_.collapse(change.edge, change.at);
                break;
            case Change::split:
                state_.split(mesh().edge_handle(change.edge), change.at);
                break;
        }
        return true;
    }

    RemeshState& state_;
    double goal_;
    int pass_ = 0;
};

}  // namespace

void polish_angles(RemeshState& state, double least_deg) {
    Polish polish(state, least_deg);
    for (int pass = 0; pass < 10 && polish.pass(pass) > 0; ++pass) {
    }
}

}  // namespace vdbgeo
