#include "vdbgeo/remesh/untangle.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/core/split_non_manifold.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/remesh/fill_holes.h"

namespace vdbgeo {
namespace {

constexpr int cycles = 3, smoothings = 6, refills = 4;
constexpr double steps[smoothings] = {0.005, 0.1, 0.5, 0.5, 0.5, 0.5};  // sheets that only touch need little

/// A mesh and what is wrong with it.
struct State {
    TriMesh mesh;
    std::uint64_t cut_faces = 0;            // that cut another
    std::vector<std::uint32_t> of_face;     // pieces
    std::vector<std::uint32_t> faces_of;    // each piece
    std::vector<std::uint32_t> mendable{};  // faces that can be mended, in rising order
    std::uint64_t refilled = 0, added = 0;

    explicit State(TriMesh made) : mesh(std::move(made)) { look(); }

    void look() {
        const auto pairs = self_intersections(mesh);
        const MeshComponents pieces = mesh_components(mesh);
        of_face = pieces.of_face;
        faces_of.clear();
        for (const MeshComponent& c : pieces.components)
            faces_of.push_back(static_cast<std::uint32_t>(c.faces));
        std::vector<std::uint32_t> all;
        mendable.clear();
        for (const auto& [a, b] : pairs) {
            all.insert(all.end(), {a, b});
            if (of_face[a] == of_face[b] || touch(a, b)) mendable.insert(mendable.end(), {a, b});
        }
        const auto make_unique = [](std::vector<std::uint32_t>& faces) {
            std::sort(faces.begin(), faces.end());
            faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
        };
        make_unique(all);
        make_unique(mendable);
        cut_faces = all.size();
    }

    /// Whether two faces have vertices at the same place, as sheets have that were taken apart.
    bool touch(std::uint32_t a, std::uint32_t b) const {
        for (const VertexId v : mesh.triangles[a])
            for (const VertexId w : mesh.triangles[b])
                if (mesh.points[v] == mesh.points[w]) return true;
        return false;
    }

    bool is_cap(std::uint32_t face) const {
        const MeshProperty* caps = mesh.find_face_property(cap_property);
        return caps && caps->values[std::size_t(face) * std::size_t(caps->components)] > 0.5f;
    }
};

/// The vertices of some faces and `rings` rings around them, in rising order.
std::vector<VertexId> vertices_of(const TriMesh& mesh, const VertexFaces& faces,
                                  const std::vector<std::uint32_t>& of, int rings) {
    std::vector<VertexId> found;
    const auto tidy = [&] {
        std::sort(found.begin(), found.end());
        found.erase(std::unique(found.begin(), found.end()), found.end());
    };
    for (const std::uint32_t f : of)
        found.insert(found.end(), mesh.triangles[f].begin(), mesh.triangles[f].end());
    tidy();
    for (int ring = 0; ring < rings; ++ring) {
        const std::vector<VertexId> inner = found;
        for (const VertexId v : inner)
            for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f)
                found.insert(found.end(), mesh.triangles[*f].begin(), mesh.triangles[*f].end());
        tidy();
    }
    return found;
}

/// Not on a border, a cap or its rim.
bool may_move(const State& state, const VertexFaces& faces, VertexStar& star, VertexId v) {
    star.fill(state.mesh, faces, v);
    bool inner = true;
    star.for_each_edge(
        [&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) { inner &= last - first == 2; });
    for (const std::uint32_t* f = faces.begin(v); inner && f != faces.end(v); ++f) inner = !state.is_cap(*f);
    return inner;
}

/// Moves the vertices of faces that cut others, and those in `rings` rings around them, by `step` of the way
/// to the mean of their neighbours, three times.
void smooth(State& state, int rings, double step) {
    const VertexFaces faces(state.mesh);
    std::vector<VertexId> moving = vertices_of(state.mesh, faces, state.mendable, rings);
    VertexStar star;
    moving.erase(std::remove_if(moving.begin(), moving.end(),
                                [&](VertexId v) { return !may_move(state, faces, star, v); }),
                 moving.end());
    std::vector<Vec3f> moved(moving.size());
    for (int pass = 0; pass < 3; ++pass) {
        for (std::size_t i = 0; i < moving.size(); ++i) {
            const VertexId v = moving[i];
            Vec3d sum = Vec3d::Zero();
            for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f) {
                const Triangle& t = state.mesh.triangles[*f];
                sum += state.mesh.points[t[(corner_of(t, v) + 1) % 3]].cast<double>();
            }
            const double count = static_cast<double>(faces.end(v) - faces.begin(v));
            moved[i] = ((1 - step) * state.mesh.points[v].cast<double>() + step / count * sum).cast<float>();
        }
        for (std::size_t i = 0; i < moving.size(); ++i) state.mesh.points[moving[i]] = moved[i];
    }
    state.look();
}

/// Takes the faces that cut others out, with `rings` rings around them, and fills the holes. False where that
/// would leave more holes than there were.
bool refill(State& state, int rings, std::uint64_t max_hole_edges) {
    const VertexFaces faces(state.mesh);
    std::vector<bool> gone(state.mesh.triangles.size(), false);
    std::vector<std::uint32_t> gone_of(state.faces_of.size(), 0);
    for (const VertexId v : vertices_of(state.mesh, faces, state.mendable, rings - 1))
        for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f) {
            if (gone[*f] || state.is_cap(*f)) continue;
            gone[*f] = true;
            ++gone_of[state.of_face[*f]];
        }
    for (std::size_t f = 0; f < gone.size(); ++f)
        if (gone_of[state.of_face[f]] == state.faces_of[state.of_face[f]]) gone[f] = false;
    const std::uint64_t open = fill_holes(state.mesh, 0).left_open;
    const std::uint64_t removed = remove_faces(state.mesh, gone);
    if (removed == 0) return false;
    state.refilled += removed;
    state.added += fill_holes(state.mesh, max_hole_edges).faces;
    split_non_manifold(state.mesh);
    const FilledHoles rest = fill_holes(state.mesh, max_hole_edges);
    state.added += rest.faces;
    if (rest.left_open > open) return false;
    const std::size_t pieces = state.faces_of.size();
    state.look();
    return state.faces_of.size() == pieces;
}

}  // namespace

Untangled untangle(TriMesh& mesh, std::uint64_t max_hole_edges, const Progress& progress) {
    State best(mesh);
    Untangled result{best.cut_faces, best.cut_faces, 0, 0, 0};
    double step = 0;
    const auto report = [&] { progress.report(++step / (cycles * (smoothings + refills) + 1)); };
    report();
    if (best.mendable.empty()) return result;
    for (int cycle = 0; cycle < cycles && !best.mendable.empty(); ++cycle) {
        const std::uint64_t before = best.cut_faces;
        State state = best;
        for (int i = 0; i < smoothings && !state.mendable.empty(); ++i, report()) {
            smooth(state, i / 2, steps[i]);
            if (state.cut_faces < best.cut_faces) best = state;
        }
        for (int i = 0; i < refills && !best.mendable.empty(); ++i, report()) {
            state = best;
            if (refill(state, 1 + i, max_hole_edges) && state.cut_faces < best.cut_faces)
                best = std::move(state);
        }
        if (best.cut_faces == before) break;
    }
    if (best.cut_faces == result.before) return result;
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        result.moved_vertices += mesh.points[v] != best.mesh.points[v];
    result.after = best.cut_faces;
    result.refilled_faces = best.refilled;
    result.added_faces = best.added;
    mesh = std::move(best.mesh);
    return result;
}

}  // namespace vdbgeo
