#include "vdbgeo/remesh/remesh_state.h"

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 256;

std::size_t index(OpenMesh::BaseHandle h) { return static_cast<std::size_t>(h.idx()); }

/// How far a face may turn in one change: its normals before and after stay within 72°.
constexpr double turn_cosine = 0.3;

bool looks_along(const Vec3d& n, const Vec3d& reference) {
    return n.dot(reference) > turn_cosine * n.norm() * reference.norm();
}

}  // namespace

RemeshState::RemeshState(const InputSurface& input, const std::vector<float>& lengths)
    : input_(input), lengths_(lengths), mesh_(to_half_edges(input.mesh(), input.adjacency())) {
    mesh_.add_property(sites_);
    mesh_.add_property(lines_);
    mesh_.add_property(caps_);
    const FaceAdjacency& adjacency = input.adjacency();
    for (VertexId v = 0; v < mesh_.n_vertices(); ++v) {
        const std::uint32_t h = adjacency.outgoing[v];
        VertexSite& s = site(VertexHandle(static_cast<int>(v)));
        const float length = lengths.size() == 1 ? lengths[0] : lengths[v];
        s.length = std::abs(length);
        s.dust = length < 0;
        s.kind = input.kind(v);
        if (h != none) s.place = s.kind == Kind::line ? input.segment_at(v) : h / 3;
    }
    int e = 0;
    for (std::uint32_t h = 0; h < adjacency.twin.size(); ++h)  // edges are numbered by their first half-edges
        if (adjacency.twin[h] > h) {
            mesh_.property(lines_, EdgeHandle(e++)) = input.segment(h);
        }
    const MeshProperty* cap = input.mesh().find_face_property(cap_property);
    if (cap && cap->components != 1) cap = nullptr;
    for (std::size_t f = 0; f < mesh_.n_faces(); ++f)
        mesh_.property(caps_, FaceHandle(static_cast<int>(f))) = cap ? cap->values[f] : 0.0f;
}

void RemeshState::set_interpolated_length(VertexSite& s, const Vec3d& weights) const {
    if (lengths_.size() == 1) return;
    const Triangle& t = input_.mesh().triangles[s.kind == Kind::line ? s.place / 3 : s.place];
    s.length = static_cast<float>(
        std::abs(weights[0] * lengths_[t[0]] + weights[1] * lengths_[t[1]] + weights[2] * lengths_[t[2]]));
}

RemeshState::Landing RemeshState::land(const Vec3d& p, const VertexSite& start) const {
    Landing out{p, start};
    if (start.kind == Kind::line) {
        const InputSurface::LineSpot spot = input_.nearest_on_line(p, start.place);
        out.point = spot.point;
        out.site.place = spot.segment;
        if (lengths_.size() > 1)
            set_interpolated_length(out.site, input_.on_face(spot.point, spot.segment / 3).weights);
    } else if (start.kind == Kind::free) {
        const InputSurface::Spot spot = input_.nearest(p, start.place);
        out.point = spot.point;
        out.site.place = spot.face;
        set_interpolated_length(out.site, spot.weights);
    }
    return out;
}

RemeshState::Landing RemeshState::split_landing(EdgeHandle e) const {
    const HalfedgeHandle h = mesh_.halfedge_handle(e, 0);
    const VertexHandle a = mesh_.from_vertex_handle(h), b = mesh_.to_vertex_handle(h);
    const Vec3d middle = 0.5 * (point(a) + point(b));
    const auto face_of = [&](VertexHandle v) {
        return site(v).kind == Kind::line ? site(v).place / 3 : site(v).place;
    };
    VertexSite start = site(a);
    start.length = static_cast<float>(length(a, b));
    if (is_line(e)) {
        start.kind = Kind::line;
        start.place = mesh_.property(lines_, e);
        return land(middle, start);
    }
    start.kind = Kind::free;
    start.place = face_of(a);
    const Landing one = land(middle, start);
    if ((one.point - middle).squaredNorm() < 0.01 * (point(a) - point(b)).squaredNorm()) return one;
    start.place = face_of(b);
    const Landing other = land(middle, start);
    return (other.point - middle).squaredNorm() < (one.point - middle).squaredNorm() ? other : one;
}

void RemeshState::split(EdgeHandle e, const Landing& at) {
    const HalfedgeHandle h = mesh_.halfedge_handle(e, 0), o = mesh_.opposite_halfedge_handle(h);
    const FaceHandle left = mesh_.face_handle(h), right = mesh_.face_handle(o);
    const std::uint32_t line = mesh_.property(lines_, e);
    const int edges = static_cast<int>(mesh_.n_edges());
    int faces = static_cast<int>(mesh_.n_faces());
    const VertexHandle v = mesh_.new_vertex(at.point);
    site(v) = at.site;
    mesh_.split(e, v);
    // OpenMesh adds the other half of the edge first, then what divides the left face, then the right one's.
    for (int i = edges; i < static_cast<int>(mesh_.n_edges()); ++i)
        mesh_.property(lines_, EdgeHandle(i)) = i == edges ? line : none;
    for (const FaceHandle side : {left, right})
        if (side.is_valid()) mesh_.property(caps_, FaceHandle(faces++)) = mesh_.property(caps_, side);
}

/// Goes from an edge to a longer one of its faces until there is none: splitting that one makes no needles.
RemeshState::EdgeHandle RemeshState::longest_near(EdgeHandle e) const {
    double longest = squared_length(e);
    for (bool longer = true; longer;) {
        longer = false;
        const EdgeHandle at = e;
        for (const unsigned int k : {0u, 1u}) {
            HalfedgeHandle h = mesh_.halfedge_handle(at, k);
            if (mesh_.is_boundary(h)) continue;
            for (int side = 0; side < 2; ++side) {
                h = mesh_.next_halfedge_handle(h);
                const double length = squared_length(mesh_.edge_handle(h));
                if (length > longest) longest = length, e = mesh_.edge_handle(h), longer = true;
            }
        }
    }
    return e;
}

double RemeshState::squared_length(EdgeHandle e) const {
    const HalfedgeHandle h = mesh_.halfedge_handle(e, 0);
    return (point(mesh_.from_vertex_handle(h)) - point(mesh_.to_vertex_handle(h))).squaredNorm();
}

bool RemeshState::is_long(EdgeHandle e, double factor) const {
    const HalfedgeHandle h = mesh_.halfedge_handle(e, 0);
    const VertexHandle a = mesh_.from_vertex_handle(h), b = mesh_.to_vertex_handle(h);
    const double limit = factor * length(a, b);
    return !site(a).dust && squared_length(e) > limit * limit;
}

void RemeshState::split_long(double factor) {
    for (int i = 0; i < static_cast<int>(mesh_.n_edges()); ++i) {  // those that come are visited too
        const EdgeHandle e(i);
        while (!mesh_.status(e).deleted() && is_long(e, factor)) {
            const EdgeHandle longest = longest_near(e);
            const HalfedgeHandle h = mesh_.halfedge_handle(longest, 0);
            const Landing at = split_landing(longest);
            const Vec3d middle =
                0.5 * (point(mesh_.from_vertex_handle(h)) + point(mesh_.to_vertex_handle(h)));
            // A walk that ends far from the middle has lost its way (the sheet folds between the ends): the
            // edges that come would be no shorter, without end.
            if ((at.point - middle).squaredNorm() > 0.0625 * squared_length(longest)) break;
            split(longest, at);
        }
    }
}

bool RemeshState::can_collapse(HalfedgeHandle h) {
    const EdgeHandle e = mesh_.edge_handle(h);
    const VertexHandle gone = mesh_.from_vertex_handle(h), kept = mesh_.to_vertex_handle(h);
    const Kind gone_kind = site(gone).kind;
    if (gone_kind == Kind::corner) return false;
    if (gone_kind == Kind::line && !is_line(e)) return false;
    for (const HalfedgeHandle side : {h, mesh_.opposite_halfedge_handle(h)}) {
        if (mesh_.is_boundary(side)) continue;
        const HalfedgeHandle a = mesh_.next_halfedge_handle(side), b = mesh_.next_halfedge_handle(a);
        // The edge from the vertex that goes becomes one with the other: a line must not be lost in it.
        if (is_line(mesh_.edge_handle(side == h ? b : a))) return false;
        const VertexHandle apex = mesh_.to_vertex_handle(a);
        if (mesh_.valence(apex) <= (mesh_.is_boundary(apex) ? 2u : 3u)) return false;
    }
    // Nothing that is closed ends as two faces back to back.
    if (!mesh_.is_boundary(gone) && !mesh_.is_boundary(kept) && mesh_.valence(gone) + mesh_.valence(kept) < 7)
        return false;
    return mesh_.is_collapse_ok(h);
}

RemeshState::Landing RemeshState::collapse_landing(HalfedgeHandle h) const {
    const VertexHandle gone = mesh_.from_vertex_handle(h), kept = mesh_.to_vertex_handle(h);
    if (site(kept).kind > site(gone).kind || site(kept).kind == Kind::corner)
        return {point(kept), site(kept)};
    return land(0.5 * (point(gone) + point(kept)), site(kept));
}

bool RemeshState::ring_keeps_shape(VertexHandle v, VertexHandle other, const Landing& at,
                                   double limit) const {
    for (auto it = mesh_.cvoh_iter(v); it.is_valid(); ++it) {
        const HalfedgeHandle h = *it;
        const VertexHandle p = mesh_.to_vertex_handle(h);
        if (p != other) {
            const double most = limit * 0.5 * (at.site.length + site(p).length);
            if ((point(p) - at.point).squaredNorm() > most * most) return false;
        }
        if (mesh_.is_boundary(h)) continue;
        const VertexHandle q = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h));
        if (p == other || q == other) continue;
        const Vec3d before = area_vector(point(v), point(p), point(q)),
                    after = area_vector(at.point, point(p), point(q));
        if (!looks_along(after, before)) return false;
    }
    return true;
}

bool RemeshState::collapse_keeps_shape(HalfedgeHandle h, const Landing& at, double limit) {
    const VertexHandle gone = mesh_.from_vertex_handle(h), kept = mesh_.to_vertex_handle(h);
    return ring_keeps_shape(gone, kept, at, limit) && ring_keeps_shape(kept, gone, at, limit);
}

void RemeshState::collapse(HalfedgeHandle h, const Landing& at) {
    const VertexHandle kept = mesh_.to_vertex_handle(h);
    mesh_.collapse(h);
    mesh_.set_point(kept, at.point);
    site(kept) = at.site;
}

void RemeshState::collapse_short(double factor, double limit) {
    for (int i = 0; i < static_cast<int>(mesh_.n_edges()); ++i) {
        const EdgeHandle e(i);
        if (mesh_.status(e).deleted()) continue;
        HalfedgeHandle h = mesh_.halfedge_handle(e, 0);
        const VertexHandle a = mesh_.from_vertex_handle(h), b = mesh_.to_vertex_handle(h);
        const double least = factor * length(a, b);
        if (site(a).dust || (point(a) - point(b)).squaredNorm() >= least * least) continue;
        if (site(a).kind > site(b).kind) h = mesh_.opposite_halfedge_handle(h);
        if (!can_collapse(h)) continue;
        const Landing at = collapse_landing(h);
        if (collapse_keeps_shape(h, at, limit)) collapse(h, at);
    }
}

bool RemeshState::can_flip(EdgeHandle e) const { return !is_line(e) && mesh_.is_flip_ok(e); }

bool RemeshState::flip_keeps_side(EdgeHandle e) const {
    const HalfedgeHandle h = mesh_.halfedge_handle(e, 0), o = mesh_.opposite_halfedge_handle(h);
    const Vec3d &a = point(mesh_.from_vertex_handle(h)), &b = point(mesh_.to_vertex_handle(h)),
                &c = point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h))),
                &d = point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(o)));
    const Vec3d before = area_vector(a, b, c) + area_vector(b, a, d);
    return looks_along(area_vector(c, d, b), before) && looks_along(area_vector(d, c, a), before);
}

/// Not to be flipped: gone, on a line, or of a piece that is only polished.
bool RemeshState::is_settled(EdgeHandle e) const {
    return mesh_.status(e).deleted() || is_line(e) ||
           site(mesh_.from_vertex_handle(mesh_.halfedge_handle(e, 0))).dust;
}

int RemeshState::valence_gain(EdgeHandle e) const {
    const HalfedgeHandle h = mesh_.halfedge_handle(e, 0), o = mesh_.opposite_halfedge_handle(h);
    const auto off = [&](VertexHandle v, int change) {
        const int over = static_cast<int>(mesh_.valence(v)) - (mesh_.is_boundary(v) ? 4 : 6);
        return over * over - (over + change) * (over + change);
    };
    return off(mesh_.from_vertex_handle(h), -1) + off(mesh_.to_vertex_handle(h), -1) +
           off(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h)), 1) +
           off(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(o)), 1);
}

void RemeshState::flip_for_valence() {
    for (int i = 0; i < static_cast<int>(mesh_.n_edges()); ++i) {
        const EdgeHandle e(i);
        if (is_settled(e)) continue;
        if (valence_gain(e) > 0 && flip_keeps_side(e) && mesh_.is_flip_ok(e)) mesh_.flip(e);
    }
}

void RemeshState::flip_for_angles() {
    for (int i = 0; i < static_cast<int>(mesh_.n_edges()); ++i) {
        const EdgeHandle e(i);
        if (is_settled(e)) continue;
        const HalfedgeHandle h = mesh_.halfedge_handle(e, 0), o = mesh_.opposite_halfedge_handle(h);
        const VertexHandle va = mesh_.from_vertex_handle(h), vb = mesh_.to_vertex_handle(h);
        const Vec3d &a = point(va), &b = point(vb),
                    &c = point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h))),
                    &d = point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(o)));
        const double before = std::max(least_angle_cosine(a, b, c), least_angle_cosine(a, b, d)),
                     after = std::max(least_angle_cosine(c, d, b), least_angle_cosine(c, d, a));
        if (after < before - 1e-3 && mesh_.valence(va) > 4 && mesh_.valence(vb) > 4 && flip_keeps_side(e) &&
            mesh_.is_flip_ok(e))
            mesh_.flip(e);
    }
}

Vec3d RemeshState::relaxed(VertexHandle v, double step) const {
    const Vec3d& p = point(v);
    if (site(v).kind == Kind::line) {
        Vec3d sum = Vec3d::Zero();
        int count = 0;
        for (auto it = mesh_.cvoh_iter(v); it.is_valid(); ++it)
            if (is_line(mesh_.edge_handle(*it))) sum += point(mesh_.to_vertex_handle(*it)), ++count;
        return count == 2 ? Vec3d(p + step * (0.5 * sum - p)) : p;
    }
    Vec3d sum = Vec3d::Zero(), normal = Vec3d::Zero();
    double total = 0;
    for (auto it = mesh_.cvoh_iter(v); it.is_valid(); ++it) {
        const HalfedgeHandle h = *it;
        const VertexHandle vq = mesh_.to_vertex_handle(h),
                           vr = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h));
        const Vec3d &q = point(vq), &r = point(vr);
        const Vec3d n = area_vector(p, q, r);
        double weight = n.norm();
        if (lengths_.size() > 1) {  // faces should have areas that go with their lengths' squares
            const double l = site(v).length + site(vq).length + site(vr).length;
            weight /= l * l;
        }
        normal += n;
        sum += weight * (q + r - 2 * p);
        total += weight;
    }
    const double squared = normal.squaredNorm();
    if (!(total > 0) || !(squared > 0)) return p;
    const Vec3d d = sum / (2 * total);
    return p + step * (d - d.dot(normal) / squared * normal);
}

void RemeshState::relax(double step) {
    const std::size_t count = mesh_.n_vertices();
    std::vector<Landing> places(count);
    parallel_for(count, grain, [&](std::size_t i) {
        const VertexHandle v(static_cast<int>(i));
        places[i] = {point(v), site(v)};
        if (mesh_.status(v).deleted() || mesh_.is_isolated(v) || site(v).kind == Kind::corner || site(v).dust)
            return;
        const Landing at = land(relaxed(v, step), site(v));
        // A walk that ends far off has lost its way.
        if ((at.point - point(v)).norm() < site(v).length) places[i] = at;
    });
    parallel_for(count, grain, [&](std::size_t i) {
        const VertexHandle v(static_cast<int>(i));
        std::swap(places[i].point, mesh_.point(v));
        std::swap(places[i].site, site(v));
    });
    undo_turned_faces(places);
}

/// Vertices of faces that turned too far or lost most of their least angle go back, until there are none:
/// with all back every face is as it was.
void RemeshState::undo_turned_faces(const std::vector<Landing>& old) {
    std::vector<unsigned char> bad(mesh_.n_faces()), back(mesh_.n_vertices(), 0);
    for (bool any = true; any;) {
        parallel_for(bad.size(), grain, [&](std::size_t f) {
            bad[f] = 0;
            const FaceHandle face(static_cast<int>(f));
            if (mesh_.status(face).deleted()) return;
            const HalfedgeHandle h = mesh_.halfedge_handle(face);
            const VertexHandle v[3] = {mesh_.from_vertex_handle(h), mesh_.to_vertex_handle(h),
                                       mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h))};
            if (back[index(v[0])] && back[index(v[1])] && back[index(v[2])]) return;
            const auto was = [&](VertexHandle u) { return old[index(u)].point; };
            const Vec3d before = area_vector(was(v[0]), was(v[1]), was(v[2])),
                        after = area_vector(point(v[0]), point(v[1]), point(v[2]));
            bad[f] = !looks_along(after, before) && before.squaredNorm() > 0;
        });
        std::vector<unsigned char> changed((mesh_.n_vertices() + grain - 1) / grain, 0);
        parallel_blocks(mesh_.n_vertices(), grain, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                const VertexHandle v(static_cast<int>(i));
                if (back[i] || mesh_.status(v).deleted()) continue;
                for (auto it = mesh_.cvf_iter(v); it.is_valid() && !back[i]; ++it)
                    if (bad[index(*it)]) back[i] = changed[begin / grain] = 1;
                if (!back[i]) continue;
                mesh_.set_point(v, old[i].point);
                site(v) = old[i].site;
            }
        });
        any = std::find(changed.begin(), changed.end(), 1) != changed.end();
    }
}

TriMesh RemeshState::result() const {
    TriMesh out = to_tri_mesh(mesh_);
    std::vector<int> vertices, faces;
    for (int v = 0; v < static_cast<int>(mesh_.n_vertices()); ++v)
        if (!mesh_.status(VertexHandle(v)).deleted() && !mesh_.is_isolated(VertexHandle(v)))
            vertices.push_back(v);
    for (int f = 0; f < static_cast<int>(mesh_.n_faces()); ++f)
        if (!mesh_.status(FaceHandle(f)).deleted()) faces.push_back(f);
    add_vertex_properties(vertices, out);
    add_face_properties(faces, out);
    return out;
}

void RemeshState::add_vertex_properties(const std::vector<int>& vertices, TriMesh& out) const {
    const TriMesh& in = input_.mesh();
    if (in.vertex_properties.empty()) return;
    for (const MeshProperty& p : in.vertex_properties) {
        out.vertex_properties.push_back({p.name, p.components, {}});
        out.vertex_properties.back().values.resize(vertices.size() * static_cast<std::size_t>(p.components));
    }
    parallel_for(vertices.size(), grain, [&](std::size_t i) {
        const VertexHandle v(vertices[i]);
        const std::uint32_t place = site(v).place;
        const InputSurface::Spot spot =
            input_.on_face(point(v), site(v).kind == Kind::line ? place / 3 : place);
        const Triangle& t = in.triangles[spot.face];
        for (std::size_t k = 0; k < in.vertex_properties.size(); ++k) {
            const MeshProperty& from = in.vertex_properties[k];
            const std::size_t n = static_cast<std::size_t>(from.components);
            for (std::size_t c = 0; c < n; ++c) {
                double value = 0;
                for (int j = 0; j < 3; ++j)
                    if (spot.weights[j] != 0)
                        value += spot.weights[j] * from.values[t[static_cast<std::size_t>(j)] * n + c];
                out.vertex_properties[k].values[i * n + c] = static_cast<float>(value);
            }
        }
    });
}

void RemeshState::add_face_properties(const std::vector<int>& faces, TriMesh& out) const {
    const TriMesh& in = input_.mesh();
    for (const MeshProperty& from : in.face_properties) {
        const std::size_t n = static_cast<std::size_t>(from.components);
        MeshProperty to{from.name, from.components, std::vector<float>(faces.size() * n)};
        const bool cap = from.name == cap_property && n == 1;
        parallel_for(faces.size(), grain, [&](std::size_t i) {
            const FaceHandle f(faces[i]);
            if (cap) {
                to.values[i] = mesh_.property(caps_, f);
                return;
            }
            const HalfedgeHandle h = mesh_.halfedge_handle(f);
            const VertexHandle a = mesh_.from_vertex_handle(h), b = mesh_.to_vertex_handle(h),
                               c = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h));
            const std::uint32_t place = site(a).kind == Kind::line ? site(a).place / 3 : site(a).place;
            const std::uint32_t face = input_.nearest((point(a) + point(b) + point(c)) / 3, place).face;
            std::copy_n(from.values.begin() + static_cast<std::ptrdiff_t>(face * n), n,
                        to.values.begin() + static_cast<std::ptrdiff_t>(i * n));
        });
        out.face_properties.push_back(std::move(to));
    }
}

}  // namespace vdbgeo
