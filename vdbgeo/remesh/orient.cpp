#include "vdbgeo/remesh/orient.h"

#include <fmt/format.h>

#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/measure/ray_bins.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 13;
constexpr std::uint32_t none = 0xFFFFFFFFu;

/// The face across each side of each face, where there is exactly one.
Array<std::uint32_t> neighbours_of(const TriMesh& mesh) {
    Array<std::uint32_t> across(3 * mesh.triangles.size());
    std::fill(across.begin(), across.end(), none);
    const VertexFaces faces(mesh);
    parallel_blocks(mesh.points.size(), block, [&](std::size_t begin, std::size_t end) {
        VertexStar star;
        for (std::size_t v = begin; v < end; ++v) {
            star.fill(mesh, faces, static_cast<VertexId>(v));
            star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
                if (last - first != 2 || v > first->other) return;
                for (const int side : {0, 1}) {
                    const std::uint32_t face = star.face(first[side].slot);
                    const VertexId start = first[side].out ? static_cast<VertexId>(v) : first->other;
                    across[3 * std::size_t(face) + corner_of(mesh.triangles[face], start)] =
                        star.face(first[1 - side].slot);
                }
            });
        }
    });
    return across;
}

/// Whether side k of a face is run through in the same direction by another face.
bool same_way(const Triangle& t, std::size_t k, const Triangle& other) {
    return other[(corner_of(other, t[k]) + 1) % 3] == t[(k + 1) % 3];
}

void turn_over(Triangle& t) { std::swap(t[1], t[2]); }

/// Goes through the patch of a face; `turned` becomes 1 for faces like the first and 2 for the others.
std::vector<std::uint32_t> walk_patch(const TriMesh& mesh, const Array<std::uint32_t>& across,
                                      std::uint32_t start, std::vector<std::uint8_t>& side) {
    std::vector<std::uint32_t> patch = {start};
    side[start] = 1;
    for (std::size_t i = 0; i < patch.size(); ++i) {
        const std::uint32_t f = patch[i];
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t g = across[3 * std::size_t(f) + k];
            if (g == none) continue;
            const bool agree = !same_way(mesh.triangles[f], k, mesh.triangles[g]);
            const auto wanted = static_cast<std::uint8_t>(agree ? side[f] : 3 - side[f]);
            if (side[g] == 0) {
                side[g] = wanted;
                patch.push_back(g);
            } else if (side[g] != wanted) {
                throw InvalidInput(fmt::format(
                    "repair: the surface around face {} has one side only (like a Moebius band), so its "
                    "faces cannot be made to agree; cut it, or leave it out",
                    start));
            }
        }
    }
    return patch;
}

/// What lies around the point of a piece that is farthest in x.
struct Surroundings {
    std::vector<std::uint32_t> around;  // closed pieces that the point is in
    bool in_open_solid = false;         // the next surface in x is an open one, seen from inside
};

struct Crossing {
    std::uint32_t ray, piece;
    RayCrossing at;
};

std::vector<Surroundings> surroundings(const TriMesh& mesh, const MeshComponents& found,
                                       const std::vector<std::uint32_t>& pieces) {
    std::vector<Surroundings> all(pieces.size());
    if (pieces.empty()) return all;
    std::vector<std::uint32_t> ray_of(found.components.size(), none);
    for (std::uint32_t i = 0; i < pieces.size(); ++i) ray_of[pieces[i]] = i;
    const RayBins bins(farthest_in_x(mesh, found.of_face, ray_of, pieces.size()));
    std::vector<Crossing> crossings;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        bins.visit(mesh, mesh.triangles[f], [&](std::uint32_t ray, const RayCrossing& at) {
            if (pieces[ray] != found.of_face[f]) crossings.push_back({ray, found.of_face[f], at});
        });
    std::stable_sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
        return a.ray != b.ray ? a.ray < b.ray : a.piece < b.piece;
    });
    std::vector<Crossing> nearest(pieces.size(), Crossing{0, none, {0, false}});
    for (std::size_t begin = 0, end; begin < crossings.size(); begin = end) {
        const std::uint32_t ray = crossings[begin].ray, piece = crossings[begin].piece;
        for (end = begin;
             end < crossings.size() && crossings[end].ray == ray && crossings[end].piece == piece; ++end)
            if (nearest[ray].piece == none || crossings[end].at.x < nearest[ray].at.x)
                nearest[ray] = crossings[end];
        if (found.components[piece].volume_A3 && (end - begin) % 2 == 1) all[ray].around.push_back(piece);
    }
    for (std::size_t i = 0; i < pieces.size(); ++i)
        all[i].in_open_solid = nearest[i].piece != none && !found.components[nearest[i].piece].volume_A3 &&
                               nearest[i].at.leaving;
    return all;
}

}  // namespace

std::uint64_t orient_patches(TriMesh& mesh) {
    const Array<std::uint32_t> across = neighbours_of(mesh);
    std::vector<std::uint8_t> side(mesh.triangles.size(), 0);
    std::uint64_t turned = 0;
    for (std::uint32_t f = 0; f < mesh.triangles.size(); ++f) {
        if (side[f] != 0) continue;
        const std::vector<std::uint32_t> patch = walk_patch(mesh, across, f, side);
        std::size_t others = 0;
        for (const std::uint32_t g : patch) others += side[g] == 2;
        const std::uint8_t wrong = 2 * others <= patch.size() ? 2 : 1;
        for (const std::uint32_t g : patch) {
            turned += side[g] == wrong;
            side[g] = side[g] == wrong ? 2 : 1;
        }
    }
    for (std::size_t f = 0; f < side.size(); ++f)
        if (side[f] == 2) turn_over(mesh.triangles[f]);
    return turned;
}

OutwardCounts turn_outward(TriMesh& mesh) {
    const MeshComponents found = mesh_components(mesh);
    std::vector<std::uint32_t> inward, outward;
    for (std::uint32_t id = 0; id < found.components.size(); ++id)
        if (found.components[id].volume_A3) (found.components[id].cavity() ? inward : outward).push_back(id);
    std::vector<bool> turn(found.components.size(), false);
    OutwardCounts counts;
    const std::vector<Surroundings> in_what = surroundings(mesh, found, inward);
    for (std::size_t i = 0; i < inward.size(); ++i) {
        turn[inward[i]] = (in_what[i].around.size() + in_what[i].in_open_solid) % 2 == 0;
        counts.pieces += turn[inward[i]];
    }
    if (counts.pieces == 0) return counts;
    const std::vector<bool> first_turn = turn;
    const std::vector<Surroundings> held_by = surroundings(mesh, found, outward);
    for (std::size_t i = 0; i < outward.size(); ++i) {
        const std::vector<std::uint32_t>& around = held_by[i].around;
        if (around.size() % 2 == 0) continue;
        const std::uint32_t holder = *std::min_element(around.begin(), around.end(), [&](auto a, auto b) {
            return std::abs(*found.components[a].volume_A3) < std::abs(*found.components[b].volume_A3);
        });
        turn[outward[i]] = first_turn[holder];
        counts.pieces += turn[outward[i]];
    }
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        if (!turn[found.of_face[f]]) continue;
        turn_over(mesh.triangles[f]);
        ++counts.faces;
    }
    return counts;
}

}  // namespace vdbgeo
