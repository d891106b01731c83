#include "vdbgeo/core/split_non_manifold.h"

#include <cmath>
#include <optional>
#include <set>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

using Spoke = VertexStar::Spoke;

constexpr std::uint32_t no_face = 0xFFFFFFFFu;

/// Faces that stay together at an edge: two, or one that has no partner.
struct Sheet {
    std::uint32_t a, b = no_face;
    std::size_t low = 0, high = 0;  // the corners of `a` at the edge's ends
};

/// A face at an edge from its lower to its higher vertex.
struct Leaf {
    std::uint32_t face;
    bool up;           // runs from the lower vertex to the higher
    double angle = 0;  // around the edge, counter-clockwise seen against its direction
};

VertexId apex(const Triangle& t, VertexId a, VertexId b) {
    for (const VertexId v : t)
        if (v != a && v != b) return v;
    return t[0];
}

void set_angles(const TriMesh& mesh, VertexId low, VertexId high, std::vector<Leaf>& leaves) {
    const Vec3d from = mesh.points[low].cast<double>();
    const Vec3d axis = (mesh.points[high].cast<double>() - from).normalized();
    std::optional<Vec3d> zero;
    for (Leaf& leaf : leaves) {
        Vec3d arm = mesh.points[apex(mesh.triangles[leaf.face], low, high)].cast<double>() - from;
        arm -= arm.dot(axis) * axis;
        if (!zero) zero = arm;
        leaf.angle = std::atan2(arm.dot(axis.cross(*zero)), arm.dot(*zero));
    }
}

/// Pairs the faces at an edge. The normal of a face that runs up the edge points to greater angles: the solid
/// begins behind faces that run down, and ends at those that run up.
std::vector<Sheet> sheets_at(const TriMesh& mesh, VertexId low, VertexId high, std::vector<Leaf> leaves) {
    set_angles(mesh, low, high, leaves);
    std::sort(leaves.begin(), leaves.end(), [](const Leaf& a, const Leaf& b) {
        return a.angle != b.angle ? a.angle < b.angle : a.up != b.up ? b.up : a.face < b.face;
    });
    std::vector<std::size_t> open;
    std::vector<std::uint32_t> partner(leaves.size(), no_face);
    for (std::size_t i = 0; i < 2 * leaves.size(); ++i) {  // twice round: the last solid may end past angle 0
        const std::size_t k = i % leaves.size();
        if (partner[k] != no_face) continue;
        if (!leaves[k].up) {
            if (i == k) open.push_back(k);
        } else if (!open.empty()) {
            partner[k] = leaves[open.back()].face;
            partner[open.back()] = leaves[k].face;
            open.pop_back();
        }
    }
    std::vector<Sheet> sheets;
    for (std::size_t k = 0; k < leaves.size(); ++k) {
        const Triangle& t = mesh.triangles[leaves[k].face];
        if (leaves[k].face < partner[k])
            sheets.push_back({leaves[k].face, partner[k], corner_of(t, low), corner_of(t, high)});
    }
    std::sort(sheets.begin(), sheets.end(), [](const Sheet& x, const Sheet& y) { return x.a < y.a; });
    return sheets;
}

/// The sheets of the edge that spokes [first, last) of a star belong to; the same from both of its ends.
std::vector<Sheet> sheets_of(const TriMesh& mesh, const VertexStar& star, const Spoke* first,
                             const Spoke* last) {
    const VertexId v = star.vertex(), other = first->other;
    std::vector<Leaf> leaves;
    for (const Spoke* s = first; s != last; ++s)
        leaves.push_back({star.face(s->slot), s->out == (v < other)});
    return sheets_at(mesh, std::min(v, other), std::max(v, other), std::move(leaves));
}

/// The vertices that have several fans or an edge of three faces or more, in rising order.
std::vector<VertexId> singular_vertices(const TriMesh& mesh, const VertexFaces& faces) {
    constexpr std::size_t block = 1 << 13;
    std::vector<std::vector<VertexId>> found((faces.vertices() + block - 1) / block);
    parallel_blocks(faces.vertices(), block, [&](std::size_t begin, std::size_t end) {
        VertexStar star;
        for (std::size_t v = begin; v < end; ++v) {
            star.fill(mesh, faces, static_cast<VertexId>(v));
            bool crowded = false;
            star.for_each_edge([&](const Spoke* first, const Spoke* last) {
                crowded |= last - first > 2;
                if (last - first == 2) star.join(first[0].slot, first[1].slot);
            });
            if (crowded || star.fan_count() > 1) found[begin / block].push_back(static_cast<VertexId>(v));
        }
    });
    std::vector<VertexId> all;
    for (const auto& part : found) all.insert(all.end(), part.begin(), part.end());
    return all;
}

/// A copy of an element, or the mean of two.
void append_element(std::vector<MeshProperty>& properties, std::size_t a, std::size_t b) {
    for (MeshProperty& p : properties) {
        const auto n = static_cast<std::size_t>(p.components);
        for (std::size_t c = 0; c < n; ++c) {
            const float x = p.values[n * a + c], y = p.values[n * b + c];
            p.values.push_back(x == y ? x : 0.5f * (x + y));
        }
    }
}

VertexId append_vertex(TriMesh& mesh, VertexId a, VertexId b) {
    if (mesh.points.size() >= TriMesh::max_vertices)
        throw InvalidInput("mesh: splitting it takes more than 2^32-1 vertices");
    mesh.points.push_back(a == b ? mesh.points[a] : Vec3f(0.5f * mesh.points[a] + 0.5f * mesh.points[b]));
    append_element(mesh.vertex_properties, a, b);
    return static_cast<VertexId>(mesh.points.size() - 1);
}

/// Gives each fan of the singular vertices a vertex of its own; returns the sheets of each edge that was
/// crowded.
std::vector<std::vector<Sheet>> split_fans(TriMesh& mesh, const VertexFaces& faces,
                                           const std::vector<VertexId>& singular) {
    struct Change {
        std::uint32_t face;
        VertexId from, to;
    };
    std::vector<Change> changes;
    std::vector<std::vector<Sheet>> crowded;
    VertexStar star;
    for (const VertexId v : singular) {
        star.fill(mesh, faces, v);
        star.for_each_edge([&](const Spoke* first, const Spoke* last) {
            if (last - first == 2) star.join(first[0].slot, first[1].slot);
            if (last - first <= 2) return;
            std::vector<Sheet> sheets = sheets_of(mesh, star, first, last);
            for (const Sheet& sheet : sheets)
                if (sheet.b != no_face) star.join(star.slot_of(sheet.a), star.slot_of(sheet.b));
            if (v < first->other) crowded.push_back(std::move(sheets));
        });
        std::vector<VertexId> vertex_of(star.face_count(), v);
        for (std::uint32_t s = 0; s < star.face_count(); ++s) {
            const std::uint32_t fan = star.fan(s);
            if (fan == s && s > 0) vertex_of[s] = append_vertex(mesh, v, v);
            if (vertex_of[fan] != v) changes.push_back({star.face(s), v, vertex_of[fan]});
        }
    }
    for (const Change& c : changes) mesh.triangles[c.face][corner_of(mesh.triangles[c.face], c.from)] = c.to;
    return crowded;
}

/// Cuts a face in two at a vertex on its edge (a, b).
void cut_face(TriMesh& mesh, std::uint32_t face, VertexId a, VertexId b, VertexId middle) {
    Triangle second = mesh.triangles[face];
    second[corner_of(second, a)] = middle;
    Triangle& first = mesh.triangles[face];
    first[corner_of(first, b)] = middle;
    mesh.triangles.push_back(second);
    append_element(mesh.face_properties, face, face);
}

/// Gives sheets that still share both ends of an edge middles of their own. A face is cut once at most; what
/// that leaves is for the next round.
void split_edges(TriMesh& mesh, const std::vector<std::vector<Sheet>>& crowded) {
    std::set<std::uint32_t> cut;
    for (const std::vector<Sheet>& sheets : crowded) {
        std::set<std::pair<VertexId, VertexId>> taken;
        for (const Sheet& sheet : sheets) {
            if (cut.count(sheet.a) || cut.count(sheet.b)) continue;
            const Triangle t = mesh.triangles[sheet.a];
            const VertexId low = t[sheet.low], high = t[sheet.high];
            if (taken.insert({low, high}).second) continue;
            const VertexId middle = append_vertex(mesh, low, high);
            for (const std::uint32_t face : {sheet.a, sheet.b}) {
                if (face == no_face) continue;
                cut_face(mesh, face, low, high, middle);
                cut.insert(face);
            }
        }
    }
}

}  // namespace

std::uint64_t split_non_manifold(TriMesh& mesh) {
    const std::size_t before = mesh.points.size();
    for (int round = 0;; ++round) {
        const VertexFaces faces(mesh);
        const std::vector<VertexId> singular = singular_vertices(mesh, faces);
        if (singular.empty()) return mesh.points.size() - before;
        if (round == 100)
            throw NumericalError("mesh: cannot be made a manifold: faces that share edges nest");
        split_edges(mesh, split_fans(mesh, faces, singular));
    }
}

}  // namespace vdbgeo
