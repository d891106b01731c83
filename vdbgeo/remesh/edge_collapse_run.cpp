// The greedy loop of EdgeCollapse: what it takes next, and what a collapse changes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/remesh/edge_collapse.h"

namespace vdbgeo {
namespace {

/// Refused edges are tried again, their surroundings having changed, when no others are left: this often
/// at most, and as long as that gains half a per cent.
constexpr int most_rounds = 20;
constexpr std::uint64_t collapses_per_report = 8192;

}  // namespace

EdgeCollapse::Best EdgeCollapse::find_best(VertexId v, const Ring& ring, const Best& floor) const {
    Best best;
    for (std::size_t i = 0; i < ring.neighbours.size(); ++i) {
        const VertexId w = ring.neighbours[i];
        if (w < v) continue;
        const Best edge{static_cast<float>(place(v, w, spoke_is_line(ring, i)).cost), w};
        if (std::isfinite(edge.cost) && floor < edge && edge < best) best = edge;
    }
    return best;
}

void EdgeCollapse::unqueue(VertexId v) {
    Vertex& vertex = vertices_[v];
    if (vertex.best.target == none) return;
    queue_.remove(v, vertex.best.cost);
    vertex.best = {};
}

void EdgeCollapse::enqueue(VertexId v, const Best& best) {
    unqueue(v);
    if (best.target == none) return;
    vertices_[v].best = best;
    queue_.push(v, best.cost);
}

void EdgeCollapse::enqueue_all() {
    parallel_blocks(vertices_.size(), 2048, [&](std::size_t begin, std::size_t end) {
        Ring ring;
        for (std::size_t v = begin; v < end; ++v) {
            if (vertices_[v].corner == none) continue;
            gather(static_cast<VertexId>(v), ring);
            vertices_[v].best = find_best(static_cast<VertexId>(v), ring, lowest_floor);
        }
    });
    for (std::size_t v = 0; v < vertices_.size(); ++v)
        if (vertices_[v].corner != none && vertices_[v].best.target != none)
            queue_.push(static_cast<VertexId>(v), vertices_[v].best.cost);
}

void EdgeCollapse::run(std::uint64_t faces, const Allowed& allowed, const Progress& progress) {
    const std::uint64_t start = faces_left_;
    std::uint64_t tried = 0, collapsed = start;
    for (int round = 0; round < most_rounds && faces_left_ > faces && collapsed > faces_left_ / 200;
         ++round) {
        collapsed = 0;
        enqueue_all();
        for (VertexId v = queue_.front(); v != none && faces_left_ > faces; v = queue_.front()) {
            prefetch_next(v);
            if (try_collapse(v, allowed)) ++collapsed;
            if (++tried % collapses_per_report == 0)
                progress.report(static_cast<double>(start - faces_left_) /
                                static_cast<double>(start - faces));
        }
    }
    for (VertexId v = queue_.front(); v != none; v = queue_.front()) unqueue(v);
    progress.report(1);
}

/// Asks for what the next collapses will need: on big meshes the waits for memory are most of the time.
void EdgeCollapse::prefetch_next(VertexId v) const {
    const VertexId soon = queue_.after(v);
    if (soon == none) return;
    const Vertex& vertex = vertices_[soon];  // asked for in the last round
    table_.prefetch(vertex.corner);
    if (vertex.best.target != none) __builtin_prefetch(&vertices_[vertex.best.target]);
    const VertexId later = queue_.after(soon);
    if (later != none) __builtin_prefetch(&vertices_[later]);
}

/// Collapses the cheapest edge of a; where it must not, the next one takes its place in the queue.
bool EdgeCollapse::try_collapse(VertexId a, const Allowed& allowed) {
    const Best best = vertices_[a].best;
    const VertexId b = best.target;
    gather(a, ring_a_);
    gather(b, ring_b_);
    const EdgeFaces faces = edge_faces(b);
    const bool line = faces.left == none || faces.right == none ||
                      is_cap(CornerTable::face_of(faces.left)) != is_cap(CornerTable::face_of(faces.right));
    const Placement placement = place(a, b, line);
    const Vec3f to = (position(a) + placement.point).cast<float>();
    proposal_.centre = to;
    proposal_.fan.clear();
    bool good =
        keeps_topology(faces) && keeps_shape(a, ring_a_, faces, to) && keeps_shape(b, ring_b_, faces, to);
    if (good && allowed) {
        const double weight = vertices_[a].quadric.trace() + vertices_[b].quadric.trace();
        proposal_.error = weight > 0 ? placement.cost / weight : 0;
        good = allowed(proposal_);
    }
    if (!good) {
        enqueue(a, find_best(a, ring_a_, best));
        return false;
    }
    merge(a, b, faces, to);
    requeue_around(a, b);
    return true;
}

/// Takes a face at the edge a–b out; its other two sides become one. The face has a at corner `at_a`, b at
/// `at_b`.
void EdgeCollapse::remove_face(Corner at_a, Corner at_b) {
    const std::uint32_t face = CornerTable::face_of(at_a);
    const Corner at_third =
        CornerTable::next(at_a) == at_b ? CornerTable::next(at_b) : CornerTable::next(at_a);
    const VertexId third = table_.vertex(at_third);
    const Corner beyond_a = table_.opposite(at_a), beyond_b = table_.opposite(at_b);
    if (beyond_a != none) table_.opposite(beyond_a) = beyond_b;
    if (beyond_b != none) table_.opposite(beyond_b) = beyond_a;
    const Corner beyond = beyond_a != none ? beyond_a : beyond_b;
    const Corner next = CornerTable::next(beyond);
    vertices_[third].corner = table_.vertex(next) == third ? next : CornerTable::previous(beyond);
    table_.remove(face);
    --faces_left_;
}

/// b becomes a part of a, which goes to `to`.
void EdgeCollapse::merge(VertexId a, VertexId b, const EdgeFaces& faces, const Vec3f& to) {
    unqueue(a);
    unqueue(b);
    Vertex &va = vertices_[a], &vb = vertices_[b];
    const Vec3d d = position(b) - position(a), x = to.cast<double>() - position(a);
    Quadric<double> sum, moved;
    sum.add(va.quadric, Vec3d::Zero());
    sum.add(vb.quadric, d);
    moved.add(sum, -x);
    moved.c = std::max(0.0, moved.c);
    va.quadric = {};
    va.quadric.add(moved, Vec3d::Zero());
    for (int i = 0; i < 3; ++i) va.position[i] = to[i];
    if (!source_.empty() && (x - d).squaredNorm() < x.squaredNorm()) source_[a] = source_[b];
    freedom_[a] = std::max(freedom_[a], freedom_[b]);
    if (faces.left != none) remove_face(faces.left, CornerTable::next(faces.left));
    if (faces.right != none) remove_face(faces.right, CornerTable::previous(faces.right));
    vb.corner = none;
    for (const Corner c : ring_b_.corners)
        if (!table_.gone(CornerTable::face_of(c))) table_.vertex(va.corner = c) = a;
    for (const Corner c : ring_a_.corners)
        if (!table_.gone(CornerTable::face_of(c))) va.corner = c;
}

/// After b went into a: the edges around a have new costs.
void EdgeCollapse::requeue_around(VertexId a, VertexId b) {
    gather(a, ring_a_);
    for (const VertexId w : ring_a_.neighbours) __builtin_prefetch(&vertices_[w]);
    enqueue(a, find_best(a, ring_a_, lowest_floor));
    for (const VertexId w : ring_a_.neighbours) table_.prefetch(vertices_[w].corner);
    for (std::size_t i = 0; i < ring_a_.neighbours.size(); ++i) {
        const VertexId w = ring_a_.neighbours[i];
        const Best& best = vertices_[w].best;
        if (best.target == b || (w < a && (best.target == a || best.target == none))) {
            gather(w, ring_b_);
            enqueue(w, find_best(w, ring_b_, lowest_floor));
        } else if (w < a) {
            const Best edge{static_cast<float>(place(w, a, spoke_is_line(ring_a_, i)).cost), a};
            if (edge < best) enqueue(w, edge);
        }
    }
}

TriMesh EdgeCollapse::mesh(const TriMesh& input) const {
    TriMesh out;
    Array<VertexId> number(vertices_.size());
    std::vector<VertexId> sources;
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
        if (vertices_[v].corner == none) continue;
        number[v] = static_cast<VertexId>(out.points.size());
        out.points.push_back(position(static_cast<VertexId>(v)).cast<float>());
        if (!source_.empty()) sources.push_back(source_[v]);
    }
    std::vector<std::uint32_t> kept;
    out.triangles.reserve(faces_left_);
    for (std::uint32_t f = 0; f < table_.face_count(); ++f) {
        if (table_.gone(f)) continue;
        out.triangles.push_back({number[table_.vertex(4 * f)], number[table_.vertex(4 * f + 1)],
                                 number[table_.vertex(4 * f + 2)]});
        if (!input.face_properties.empty()) kept.push_back(f);
    }
    const auto pick = [](const MeshProperty& from, const std::vector<std::uint32_t>& elements) {
        MeshProperty to{from.name, from.components, {}};
        const std::size_t width = static_cast<std::size_t>(from.components);
        to.values.reserve(elements.size() * width);
        for (const std::uint32_t e : elements)
            for (std::size_t i = 0; i < width; ++i) to.values.push_back(from.values[e * width + i]);
        return to;
    };
    for (const MeshProperty& p : input.vertex_properties) out.vertex_properties.push_back(pick(p, sources));
    for (const MeshProperty& p : input.face_properties) out.face_properties.push_back(pick(p, kept));
    return out;
}

}  // namespace vdbgeo
