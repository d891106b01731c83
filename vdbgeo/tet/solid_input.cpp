#include "vdbgeo/tet/solid_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/requirements.h"
#include "vdbgeo/measure/self_intersections.h"
#include "vdbgeo/tet/seed_points.h"
#include "vdbgeo/tet/void_sides.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;

std::string place(const Vec3d& p) { return fmt::format("{:.6g}, {:.6g}, {:.6g}", p.x(), p.y(), p.z()); }

Vec3d middle(const TriMesh& mesh, std::size_t face) {
    Vec3d sum = Vec3d::Zero();
    for (const VertexId v : mesh.triangles[face]) sum += mesh.points[v].cast<double>();
    return sum / 3;
}

void refuse_faces_without_area(const TriMesh& mesh, const std::string& stage) {
    std::uint64_t count = 0;
    std::size_t first = 0;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                    c = mesh.points[t[2]].cast<double>();
        if ((b - a).cross(c - a).squaredNorm() > 0) continue;
        if (count++ == 0) first = f;
    }
    if (count > 0)
        throw InvalidInput(
            fmt::format("{} needs faces with an area: {} {} none, such as face {} at {}; try "
                        "repair or remesh",
                        stage, count, count == 1 ? "has" : "have", first, place(middle(mesh, first))));
}

/// The faces of each label, the labels in order; all faces as label 0 where there is no property `label`.
std::map<std::int32_t, std::vector<std::uint32_t>> faces_by_label(const TriMesh& mesh,
                                                                  const std::string& stage) {
    std::map<std::int32_t, std::vector<std::uint32_t>> faces;
    const MeshProperty* label = mesh.find_face_property("label");
    if (!label || label->components != 1) {
        faces[0].resize(mesh.triangles.size());
        std::iota(faces[0].begin(), faces[0].end(), 0u);
        return faces;
    }
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const float value = label->values[f];
        if (!(value >= 1 && value <= 0x1p24f) || std::floor(value) != value)
            throw InvalidInput(
                fmt::format("{}: face {} has the label {}, where whole numbers from 1 to 2^24 are needed",
                            stage, f, value));
        faces[static_cast<std::int32_t>(value)].push_back(static_cast<std::uint32_t>(f));
    }
    return faces;
}

/// The closed pieces of a surface and the solids that they bound.
struct Pieces {
    std::vector<std::uint32_t> of_face;
    std::vector<std::int32_t> solid;  ///< of each piece
    std::vector<bool> cavity;
    std::vector<SolidInput::Region> solids;

    std::int32_t solid_of_face(std::size_t f) const { return solid[of_face[f]]; }
};

[[noreturn]] void throw_inside_out(const MeshComponents& found, const MeshComponent& piece,
                                   const std::string& stage) {
    const auto inward = std::count_if(found.components.begin(), found.components.end(),
                                      [](const MeshComponent& c) { return c.cavity(); });
    if (static_cast<std::size_t>(inward) == found.components.size())
        throw InvalidInput(
            fmt::format("{} needs a surface that is turned outward: it is inside out; try repair", stage));
    throw InvalidInput(
        fmt::format("{} needs pieces that are turned outward, or inward in a shell: the one of {} faces "
                    "about {} is inside "
                    "out; try repair",
                    stage, piece.faces, place(piece.centroid)));
}

/// Adds the pieces of one label.
void add_pieces(const TriMesh& mesh, const std::vector<std::uint32_t>& faces, std::int32_t label,
                const std::string& stage, Pieces& pieces) {
    const bool whole = faces.size() == mesh.triangles.size();
    const TriMesh part = whole ? TriMesh{mesh.points, mesh.triangles, {}, {}} : pick_faces(mesh, faces);
    const std::string name = label == 0 ? stage : fmt::format("{}: label {}", stage, label);
    require(measure_mesh(part), {true, true, true, true}, name);
    const MeshComponents found = mesh_components(part);
    const auto shells = shells_of_cavities(part, found);
    const auto first_piece = static_cast<std::uint32_t>(pieces.solid.size());
    for (const MeshComponent& c : found.components) {
        if (!c.volume_A3 || *c.volume_A3 == 0)
            throw InvalidInput(fmt::format("{}: the piece of {} faces about {} encloses nothing", name,
                                           c.faces, place(c.centroid)));
        pieces.cavity.push_back(c.cavity());
        pieces.solid.push_back(c.cavity() ? SolidInput::outside
                                          : static_cast<std::int32_t>(pieces.solids.size()));
        if (c.cavity()) continue;
        const std::int32_t region = label == 0 ? static_cast<std::int32_t>(pieces.solids.size()) + 1 : label;
        pieces.solids.push_back({region, Vec3d::Zero(), *c.volume_A3});
    }
    for (std::size_t i = 0; i < found.components.size(); ++i) {
        if (!found.components[i].cavity()) continue;
        if (!shells[i]) throw_inside_out(found, found.components[i], name);
        std::int32_t& solid = pieces.solid[first_piece + i];
        solid = pieces.solid[first_piece + *shells[i]];
        pieces.solids[static_cast<std::size_t>(solid)].volume_A3 += *found.components[i].volume_A3;
    }
    for (std::size_t i = 0; i < faces.size(); ++i) pieces.of_face[faces[i]] = first_piece + found.of_face[i];
}

Pieces find_pieces(const TriMesh& mesh, const std::string& stage) {
    Pieces pieces;
    pieces.of_face.resize(mesh.triangles.size());
    for (const auto& [label, faces] : faces_by_label(mesh, stage))
        add_pieces(mesh, faces, label, stage, pieces);
    return pieces;
}

/// The surface with one point for all vertices of the same coordinates that faces use, in their order.
TriMesh welded(const TriMesh& mesh) {
    std::vector<bool> used(mesh.points.size(), false);
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t) used[v] = true;
    std::vector<VertexId> order;
    for (VertexId v = 0; v < mesh.points.size(); ++v)
        if (used[v]) order.push_back(v);
    const auto before = [&](VertexId a, VertexId b) {
        const Vec3f &p = mesh.points[a], &q = mesh.points[b];
        for (int k = 0; k < 3; ++k)
            if (p[k] != q[k]) return p[k] < q[k];
        return a < b;
    };
    std::sort(order.begin(), order.end(), before);
    std::vector<VertexId> first(mesh.points.size(), none);
    for (std::size_t i = 0; i < order.size(); ++i) {
        const bool same = i > 0 && mesh.points[order[i]] == mesh.points[order[i - 1]];
        first[order[i]] = same ? first[order[i - 1]] : order[i];
    }
    TriMesh result;
    std::vector<VertexId> number(mesh.points.size(), none);
    for (VertexId v = 0; v < mesh.points.size(); ++v) {
        if (first[v] != v) continue;
        number[v] = static_cast<VertexId>(result.points.size());
        result.points.push_back(mesh.points[v]);
    }
    for (const Triangle& t : mesh.triangles)
        result.triangles.push_back({number[first[t[0]]], number[first[t[1]]], number[first[t[2]]]});
    return result;
}

/// The corners from the lowest on, and whether the face runs through them in ascending order.
struct FaceKey {
    Triangle corners;
    bool even;
    std::uint32_t face;

    FaceKey(const Triangle& t, std::uint32_t f) : corners(t), face(f) {
        std::sort(corners.begin(), corners.end());
        const auto lowest = std::find(t.begin(), t.end(), corners[0]) - t.begin();
        even = t[static_cast<std::size_t>(lowest + 1) % 3] == corners[1];
    }
    bool operator<(const FaceKey& o) const {
        return corners != o.corners ? corners < o.corners : face < o.face;
    }
};

/// The faces of the welded surface, each once, with the solids on its sides.
struct Sides {
    TriMesh mesh;
    std::vector<std::uint32_t> face;  ///< of the surface
    Array<std::array<std::int32_t, 2>> solids;
    std::vector<std::array<std::uint32_t, 2>> pieces;  ///< whose faces these are; none
};

Sides merge_faces(TriMesh mesh, const Pieces& pieces, const std::string& stage) {
    std::vector<FaceKey> keys;
    keys.reserve(mesh.triangles.size());
    for (std::uint32_t f = 0; f < mesh.triangles.size(); ++f) keys.emplace_back(mesh.triangles[f], f);
    std::sort(keys.begin(), keys.end());
    std::vector<std::uint32_t> twin(keys.size(), none);
    for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
        const FaceKey &a = keys[i], &b = keys[i + 1];
        if (a.corners != b.corners) continue;
        const bool third = i > 0 && keys[i - 1].corners == a.corners;
        if (third || a.even == b.even || pieces.solid_of_face(a.face) == pieces.solid_of_face(b.face))
            throw InvalidInput(
                fmt::format("{} needs faces apart from each other, or two solids that touch: faces {} and {} "
                            "at {} lie on each other; try repair",
                            stage, a.face, b.face, place(middle(mesh, a.face))));
        twin[a.face] = b.face;
        twin[b.face] = a.face;
    }
    Sides sides;
    for (std::uint32_t f = 0; f < mesh.triangles.size(); ++f) {
        const std::uint32_t other = twin[f];
        if (other < f) continue;  // none is above all
        sides.mesh.triangles.push_back(mesh.triangles[f]);
        sides.face.push_back(f);
        sides.solids.push_back(
            {pieces.solid_of_face(f), other == none ? SolidInput::outside : pieces.solid_of_face(other)});
        sides.pieces.push_back({pieces.of_face[f], other == none ? none : pieces.of_face[other]});
    }
    sides.mesh.points = std::move(mesh.points);
    return sides;
}

void refuse_cuts(const Sides& sides, const std::string& stage, const Progress& progress) {
    if (!have_self_intersections()) return;
    const auto pairs = self_intersections(sides.mesh, progress);
    if (pairs.empty()) return;
    const auto [a, b] = pairs.front();
    throw InvalidInput(
        fmt::format("{} needs a surface that does not cut itself: {} {} of faces cut or touch each other, "
                    "such as {} and {} "
                    "at {}; try repair or remesh",
                    stage, pairs.size(), pairs.size() == 1 ? "pair" : "pairs", sides.face[a], sides.face[b],
                    place(middle(sides.mesh, a))));
}

/// Six times the volume that faces enclose together, about a point near them.
double enclosed(const TriMesh& mesh, const std::vector<std::uint32_t>& faces) {
    const Vec3d o = mesh.points[mesh.triangles[faces.front()][0]].cast<double>();
    double sum = 0;
    for (const std::uint32_t f : faces) {
        const Triangle& t = mesh.triangles[f];
        sum += (mesh.points[t[0]].cast<double>() - o)
                   .dot((mesh.points[t[1]].cast<double>() - o).cross(mesh.points[t[2]].cast<double>() - o));
    }
    return sum;
}

/// The sides of the faces of each piece, in its solid.
std::vector<std::vector<FaceSide>> sides_of_pieces(const Sides& sides, std::size_t pieces) {
    std::vector<std::vector<FaceSide>> spaces(pieces);
    for (std::uint32_t f = 0; f < sides.face.size(); ++f)
        for (std::uint32_t s = 0; s < 2; ++s)
            if (sides.pieces[f][s] != none) spaces[sides.pieces[f][s]].push_back(2 * f + s);
    return spaces;
}

/// Adds the sides of the faces around each empty space that is enclosed.
void add_enclosed_voids(const Sides& sides, std::vector<std::vector<FaceSide>>& spaces) {
    std::vector<bool> empty(sides.face.size());
    for (std::size_t f = 0; f < empty.size(); ++f) empty[f] = sides.solids[f][1] == SolidInput::outside;
    for (const std::vector<std::uint32_t>& part : void_sides(sides.mesh, empty)) {
        if (!(enclosed(sides.mesh, part) < 0)) continue;
        spaces.emplace_back();
        for (const std::uint32_t f : part) spaces.back().push_back(2 * f + 1);
    }
}

struct Seed {
    Vec3d point;
    int winding;
};

/// A point of each space: of those with the winding number that it should have, 1 in the first `solid` spaces
/// and 0 in the others, the one farthest from the surface.
std::vector<Seed> choose_seeds(const TriMesh& surface, const Sides& sides,
                               const std::vector<std::vector<FaceSide>>& spaces, std::size_t solid,
                               const std::string& stage) {
    const auto found = seed_points(sides.mesh, spaces);
    std::vector<Vec3d> points;
    for (const auto& of_space : found)
        for (const SeedPoint& seed : of_space) points.push_back(seed.point);
    const std::vector<int> windings = winding_numbers(surface, points);
    std::vector<Seed> seeds;
    for (std::size_t s = 0, first = 0; s < spaces.size(); first += found[s++].size()) {
        if (found[s].empty())
            throw InvalidInput(
                fmt::format("{}: there is no point between the faces about {}: they are too "
                            "close to each other",
                            stage, place(middle(sides.mesh, spaces[s].front() / 2))));
        const int wanted = s < solid ? 1 : 0;
        std::size_t best = first;
        while (best < first + found[s].size() && windings[best] != wanted) ++best;
        if (best == first + found[s].size()) best = first;
        seeds.push_back({points[best], windings[best]});
    }
    return seeds;
}

/// Sets the points inside the regions and holes, and checks that solids do not overlap.
void set_seeds(const TriMesh& surface, const Sides& sides, const Pieces& pieces, const std::string& stage,
               SolidInput& input) {
    const std::size_t count = pieces.solid.size();
    auto spaces = sides_of_pieces(sides, count);
    add_enclosed_voids(sides, spaces);
    const std::vector<Seed> seeds = choose_seeds(surface, sides, spaces, count, stage);
    for (std::size_t p = 0; p < count; ++p) {
        const auto& [point, winding] = seeds[p];
        if (winding > 1)
            throw InvalidInput(fmt::format(
                "{}: a solid lies in another one about {}; turn its surface inward where it is a cavity, or "
                "give both a label",
                stage, place(point)));
        if (winding < 1 && !pieces.cavity[p])
            throw InvalidInput(
                fmt::format("{}: the piece about {} is too thin to tell its inside from its "
                            "outside; drop small pieces (--min-volume), or try remesh",
                            stage, place(point)));
        if (winding < 1)
            throw InvalidInput(fmt::format(
                "{} needs pieces that are turned outward, or inward in a shell: the one about {} is inside "
                "out; try repair",
                stage, place(point)));
        if (!pieces.cavity[p]) input.regions[static_cast<std::size_t>(pieces.solid[p])].inside = point;
    }
    for (std::size_t s = count; s < seeds.size(); ++s) input.holes.push_back(seeds[s].point);
}

}  // namespace

SolidInput solid_input(const TriMesh& surface, const std::string& stage, const Progress& progress) {
    check(surface, stage);
    if (surface.empty()) throw InvalidInput(stage + " needs a mesh that is not empty: it has no faces");
    if (surface.triangles.size() >= 1u << 31)
        throw InvalidInput(
            fmt::format("{}: {} faces, where fewer than 2^31 are needed", stage, surface.triangles.size()));
    refuse_faces_without_area(surface, stage);
    const Pieces pieces = find_pieces(surface, stage);
    progress.report(0.3);
    Sides sides = merge_faces(welded(surface), pieces, stage);
    progress.report(0.4);
    refuse_cuts(sides, stage, progress.part(0.4, 0.9));
    SolidInput input;
    input.regions = pieces.solids;
    set_seeds(surface, sides, pieces, stage, input);
    for (const Vec3f& p : sides.mesh.points) input.points.push_back(p.cast<double>());
    input.triangles = std::move(sides.mesh.triangles);
    input.solids = std::move(sides.solids);
    progress.report(1);
    return input;
}

}  // namespace vdbgeo
