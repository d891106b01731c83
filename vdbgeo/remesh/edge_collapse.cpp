#include "vdbgeo/remesh/edge_collapse.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Pull of each vertex towards where it was, against the pull of its planes: makes flat places well-posed and
/// their triangles rounder, and is small enough to leave the distance as it is.
constexpr double centre_weight = 1e-3;
/// Of the planes that stand upright on borders and rims, for an edge's squared length.
constexpr double line_weight = 10;
/// A face may turn by arccos of this in one collapse.
constexpr double least_cosine = 0.2;
/// More neighbours are not made.
constexpr std::size_t most_neighbours = 24;

}  // namespace

EdgeCollapse::EdgeCollapse(const TriMesh& mesh, const std::string& stage)
    : table_(mesh, stage),
      vertices_(mesh.points.size()),
      freedom_(mesh.points.size(), Freedom::free),
      queue_(mesh.points.size()),
      faces_left_(mesh.triangles.size()) {
    if (const MeshProperty* cap = mesh.find_face_property(cap_property); cap && cap->components == 1) {
        caps_.resize(mesh.triangles.size());
        for (std::size_t f = 0; f < caps_.size(); ++f) caps_[f] = cap->values[f] > 0.5f;
    }
    if (!mesh.vertex_properties.empty()) {
        source_.resize(mesh.points.size());
        for (std::size_t v = 0; v < source_.size(); ++v) source_[v] = static_cast<VertexId>(v);
    }
    parallel_for(vertices_.size(), 2048, [&](std::size_t v) {
        for (int i = 0; i < 3; ++i) vertices_[v].position[i] = mesh.points[v][i];
        vertices_[v].corner = table_.first_corners()[v];
        vertices_[v].best = {};
    });
    table_.drop_first_corners();
    parallel_for(vertices_.size(), 2048, [&](std::size_t v) { set_up(static_cast<VertexId>(v)); });
}

/// Whether the edge that corner c looks at is on a border or a rim.
bool EdgeCollapse::is_line(Corner c) const {
    const Corner other = table_.opposite(c);
    return other == none ||
           (!caps_.empty() && is_cap(CornerTable::face_of(c)) != is_cap(CornerTable::face_of(other)));
}

/// The quadric of a vertex from the planes of its faces, and what it may do.
void EdgeCollapse::set_up(VertexId v) {
    Vertex& vertex = vertices_[v];
    if (vertex.corner == none) return;
    Quadric<double> sum;
    const Vec3d centre = position(v);
    int lines = 0;
    Corner c = vertex.corner;
    while (c != none) {
        const Corner next = CornerTable::next(c), previous = CornerTable::previous(c);
        const Vec3d e1 = position(table_.vertex(next)) - centre,
                    e2 = position(table_.vertex(previous)) - centre;
        const Vec3d cross = e1.cross(e2);
        const double length = cross.norm();
        const bool line1 = is_line(previous), line2 = is_line(next);
        sum.add_centre(centre_weight * length);
        if (length > 0) {
            const Vec3d normal = cross / length;
            sum.add_plane(normal, length / 2);
            if (line1) sum.add_plane(e1.cross(normal).normalized(), line_weight * e1.squaredNorm());
            if (line2) sum.add_plane(e2.cross(normal).normalized(), line_weight * e2.squaredNorm());
        }
        lines += line1 ? 1 : 0;
        const Corner left = table_.left(c);
        if (left == none && line2) ++lines;
        c = left == vertex.corner ? none : left;
    }
    freedom_[v] = lines == 0 ? Freedom::free : lines == 2 ? Freedom::line : Freedom::fixed;
    vertex.quadric = {};
    vertex.quadric.add(sum, Vec3d::Zero());
}

void EdgeCollapse::gather(VertexId v, Ring& ring) const {
    ring.clear();
    Corner start = vertices_[v].corner;
    if (freedom_[v] != Freedom::free)  // to the right end of an open fan
        for (Corner c = table_.right(start); c != none && c != vertices_[v].corner; c = table_.right(c))
            start = c;
    Corner c = start;
    do {
        ring.corners.push_back(c);
        ring.neighbours.push_back(table_.vertex(CornerTable::next(c)));
        const Corner left = table_.left(c);
        if (left == none) ring.neighbours.push_back(table_.vertex(CornerTable::previous(c)));
        c = left;
    } while (c != none && c != start);
}

/// Whether the edge to neighbour i is on a border or a rim.
bool EdgeCollapse::spoke_is_line(const Ring& ring, std::size_t i) const {
    return i == ring.corners.size() || is_line(CornerTable::previous(ring.corners[i]));
}

/// Where the edge's vertex would go, and what that costs. `line`: the edge is on a border or a rim.
EdgeCollapse::Placement EdgeCollapse::place(VertexId a, VertexId b, bool line) const {
    const Freedom at_a = freedom_[a], at_b = freedom_[b];
    const Vertex &va = vertices_[a], &vb = vertices_[b];
    if (at_a != Freedom::free && at_b != Freedom::free && (!line || (at_a == Freedom::fixed && at_b == at_a)))
        return {infinity, Vec3d::Zero()};
    const Vec3d d = position(b) - position(a);
    Quadric<double> sum;
    sum.add(va.quadric, Vec3d::Zero());
    sum.add(vb.quadric, d);
    Vec3d x = at_a > at_b ? Vec3d(0, 0, 0) : d;
    if (at_a == at_b && !(sum.minimum(x) && (x - d / 2).squaredNorm() <= 4 * d.squaredNorm())) {
        x = d / 2;
        for (const Vec3d& end : {Vec3d(0, 0, 0), d})
            if (sum.value(end) < sum.value(x)) x = end;
    }
    return {std::max(0.0, sum.value(x)), x};
}

/// The faces at the edge from the vertex of ring_a_ to b.
EdgeCollapse::EdgeFaces EdgeCollapse::edge_faces(VertexId b) const {
    const auto& neighbours = ring_a_.neighbours;
    const std::size_t i =
        static_cast<std::size_t>(std::find(neighbours.begin(), neighbours.end(), b) - neighbours.begin());
    const std::size_t corners = ring_a_.corners.size();
    EdgeFaces faces;
    if (i < corners) faces.left = ring_a_.corners[i];
    if (i > 0)
        faces.right = ring_a_.corners[i - 1];
    else if (neighbours.size() == corners)
        faces.right = ring_a_.corners.back();
    return faces;
}

/// The link condition (Dey et al. 1999): the vertices that both ends see are those across the edge's faces,
/// and what is left is no pair of faces back to back. No border, rim or component goes.
bool EdgeCollapse::keeps_topology(const EdgeFaces& faces) const {
    std::size_t common = 0, across = 0;
    for (const VertexId v : ring_a_.neighbours)
        for (const VertexId w : ring_b_.neighbours) common += v == w;
    std::uint32_t beyond[2][2] = {{none, none}, {none, none}};
    for (const Corner c : {faces.left, faces.right}) {
        if (c == none) continue;
        // The edge's face has a at c and b at next or previous; the other two sides are seen from a and from
        // b.
        const Corner b = c == faces.left ? CornerTable::next(c) : CornerTable::previous(c);
        if (is_line(c) && is_line(b)) return false;
        if (table_.opposite(c) != none) beyond[across][0] = CornerTable::face_of(table_.opposite(c));
        if (table_.opposite(b) != none) beyond[across][1] = CornerTable::face_of(table_.opposite(b));
        ++across;
    }
    if (common != across) return false;
    const bool tetrahedron = across == 2 && beyond[0][0] != none && beyond[0][0] == beyond[1][0] &&
                             beyond[0][1] != none && beyond[0][1] == beyond[1][1];
    return !tetrahedron &&
           ring_a_.neighbours.size() + ring_b_.neighbours.size() <= most_neighbours + 2 + across;
}

/// Whether no face around v that stays turns over or loses its area when v goes to `to`. Notes the faces.
bool EdgeCollapse::keeps_shape(VertexId v, const Ring& ring, const EdgeFaces& faces, const Vec3f& to) {
    const Vec3d from = position(v), x = to.cast<double>();
    for (const Corner c : ring.corners) {
        const std::uint32_t face = CornerTable::face_of(c);
        if ((faces.left != none && face == CornerTable::face_of(faces.left)) ||
            (faces.right != none && face == CornerTable::face_of(faces.right)))
            continue;
        const VertexId n = table_.vertex(CornerTable::next(c)), p = table_.vertex(CornerTable::previous(c));
        const Vec3d at_n = position(n), at_p = position(p);
        const Vec3d before = (at_n - from).cross(at_p - from), after = (at_n - x).cross(at_p - x);
        const double dot = before.dot(after), squared_before = before.squaredNorm(),
                     squared_after = after.squaredNorm();
        if (!(squared_after > 0)) return false;
        if (squared_before > 0 &&
            !(dot > 0 && dot * dot > least_cosine * least_cosine * squared_before * squared_after))
            return false;
        proposal_.fan.emplace_back(at_n.cast<float>(), at_p.cast<float>());
    }
    return true;
}

}  // namespace vdbgeo
