#include "vdbgeo/measure/mesh_components.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <numeric>

#include "vdbgeo/core/disjoint_sets.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/ray_bins.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 14;
constexpr std::uint32_t none = 0xFFFFFFFFu;

/// What is summed over a piece's faces. Positions are relative to its first vertex, so that nothing cancels
/// in dust far from the origin.
struct Sums {
    Vec3d origin = Vec3d::Zero(), area_moment = Vec3d::Zero(), corners = Vec3d::Zero();
    double volume = 0;
};

/// Numbers the pieces by their first face; `of_vertex` is `none` for unused vertices.
std::uint32_t number_pieces(const TriMesh& mesh, std::vector<std::uint32_t>& of_vertex,
                            std::vector<std::uint32_t>& of_face) {
    DisjointSets sets(mesh.points.size());
    for (const Triangle& t : mesh.triangles) {
        if (degenerate(t)) continue;
        sets.join(t[0], t[1]);
        sets.join(t[0], t[2]);
    }
    std::vector<std::uint32_t> name(mesh.points.size(), none);
    of_face.resize(mesh.triangles.size());
    std::uint32_t count = 0;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        std::uint32_t& id = name[sets.find(mesh.triangles[f][0])];
        if (id == none) id = count++;
        of_face[f] = id;
    }
    of_vertex.assign(mesh.points.size(), none);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        for (const VertexId v : mesh.triangles[f])
            if (of_vertex[v] == none)
                of_vertex[v] = name[sets.find(v)] == none ? of_face[f] : name[sets.find(v)];
    return count;
}

void sum_faces(const TriMesh& mesh, const std::vector<std::uint32_t>& of_face,
               std::vector<MeshComponent>& pieces, std::vector<Sums>& sums) {
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        MeshComponent& piece = pieces[of_face[f]];
        Sums& s = sums[of_face[f]];
        if (piece.faces++ == 0) s.origin = mesh.points[t[0]].cast<double>();
        std::array<Vec3d, 3> p;
        for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[t[k]].cast<double>() - s.origin;
        const Vec3d normal = (p[1] - p[0]).cross(p[2] - p[0]), sum = p[0] + p[1] + p[2];
        s.volume += p[0].dot(normal) / 6;
        s.corners += sum;
        if (caps && caps->values[f * static_cast<std::size_t>(caps->components)] > 0.5f) {
            piece.touches_border = true;
            continue;
        }
        const double area = 0.5 * normal.norm();
        piece.area_A2 += area;
        s.area_moment += area / 3 * sum;
    }
}

/// Per piece: bit 0 has boundary edges, bit 1 is not closed or not oriented.
std::vector<std::atomic<std::uint8_t>> find_borders(const TriMesh& mesh,
                                                    const std::vector<std::uint32_t>& of_vertex,
                                                    std::size_t count) {
    std::vector<std::atomic<std::uint8_t>> marks(count);
    const VertexFaces faces(mesh);
    parallel_blocks(mesh.points.size(), block, [&](std::size_t begin, std::size_t end) {
        VertexStar star;
        for (std::size_t v = begin; v < end; ++v) {
            star.fill(mesh, faces, static_cast<VertexId>(v));
            std::uint8_t mark = 0;
            star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
                if (last - first == 1) mark |= 3;
                if (last - first > 2 || (last - first == 2 && first[0].out == first[1].out)) mark |= 2;
            });
            if (mark) marks[of_vertex[v]].fetch_or(mark, std::memory_order_relaxed);
        }
    });
    return marks;
}

/// The largest area first; the pieces come in the order of their first faces.
void sort_pieces(MeshComponents& found) {
    const std::size_t count = found.components.size();
    std::vector<std::uint32_t> order(count), place(count);
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return found.components[a].area_A2 > found.components[b].area_A2;
    });
    std::vector<MeshComponent> sorted(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        sorted[i] = found.components[order[i]];
        place[order[i]] = i;
    }
    found.components = std::move(sorted);
    for (std::uint32_t& id : found.of_face) id = place[id];
}

struct Hit {
    double x = std::numeric_limits<double>::infinity();
    std::uint32_t piece = none;
};

/// Where each ray from a piece first leaves a solid of another piece; of equals the lowest piece.
std::vector<Hit> first_hits(const TriMesh& mesh, const std::vector<std::uint32_t>& of_face,
                            const std::vector<Vec3f>& starts, const std::vector<std::uint32_t>& own) {
    const RayBins bins(starts);
    std::vector<Hit> hits(starts.size());
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        bins.visit(mesh, mesh.triangles[f], [&](std::uint32_t ray, const RayCrossing& crossing) {
            const std::uint32_t piece = of_face[f];
            Hit& hit = hits[ray];
            if (!crossing.leaving || own[ray] == piece) return;
            if (crossing.x < hit.x || (crossing.x == hit.x && piece < hit.piece)) hit = {crossing.x, piece};
        });
    return hits;
}

}  // namespace

MeshComponents mesh_components(const TriMesh& mesh, const Progress& progress) {
    check(mesh, "mesh");
    MeshComponents found;
    std::vector<std::uint32_t> of_vertex;
    const std::uint32_t count = number_pieces(mesh, of_vertex, found.of_face);
    progress.report(0.3);
    found.components.resize(count);
    std::vector<Sums> sums(count);
    sum_faces(mesh, found.of_face, found.components, sums);
    for (const std::uint32_t id : of_vertex)
        if (id != none) ++found.components[id].vertices;
    progress.report(0.6);
    const auto marks = find_borders(mesh, of_vertex, count);
    for (std::uint32_t id = 0; id < count; ++id) {
        MeshComponent& piece = found.components[id];
        const Sums& s = sums[id];
        const int mark = marks[id];
        if (mark & 1) piece.touches_border = true;
        if (!mark) piece.volume_A3 = s.volume;
        piece.centroid = s.origin + (piece.area_A2 > 0 ? Vec3d(s.area_moment / piece.area_A2)
                                                       : Vec3d(s.corners / (3 * double(piece.faces))));
    }
    sort_pieces(found);
    progress.report(1);
    return found;
}

std::vector<std::optional<std::uint32_t>> shells_of_cavities(const TriMesh& mesh,
                                                             const MeshComponents& found) {
    const std::size_t count = found.components.size();
    std::vector<std::optional<std::uint32_t>> shells(count);
    std::vector<std::uint32_t> cavities, ray_of(count, none);
    for (std::uint32_t id = 0; id < count; ++id) {
        if (!found.components[id].cavity()) continue;
        ray_of[id] = static_cast<std::uint32_t>(cavities.size());
        cavities.push_back(id);
    }
    if (cavities.empty()) return shells;
    const std::vector<Vec3f> starts = farthest_in_x(mesh, found.of_face, ray_of, cavities.size());
    const std::vector<Hit> hits = first_hits(mesh, found.of_face, starts, cavities);
    // A cavity that is hit reaches further in x than the one whose ray hits it: chains end.
    std::vector<std::uint32_t> order(cavities.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return starts[a].x() != starts[b].x() ? starts[a].x() > starts[b].x() : a < b;
    });
    for (const std::uint32_t ray : order) {
        const std::uint32_t hit = hits[ray].piece;
        if (hit == none) continue;
        if (ray_of[hit] == none)
            shells[cavities[ray]] = hit;
        else
            shells[cavities[ray]] = shells[hit];
    }
    return shells;
}

void ComponentFilter::check() const {
    if (keep_largest && *keep_largest == 0)
        throw InvalidInput("components: the number of pieces to keep is 0, where 1 or more is needed");
    const std::pair<const char*, double> bounds[] = {{"volume", min_volume_A3}, {"area", min_area_A2}};
    for (const auto& [name, value] : bounds)
        if (!std::isfinite(value) || value < 0)
            throw InvalidInput(
                fmt::format("components: the least {} is {}, where 0 or more is needed", name, value));
}

TriMesh extract_components(const TriMesh& mesh, const MeshComponents& found, const std::vector<bool>& keep) {
    if (keep.size() != found.components.size() || found.of_face.size() != mesh.triangles.size())
        throw InvalidInput(
            fmt::format("components: {} flags for {} pieces", keep.size(), found.components.size()));
    std::vector<std::uint32_t> faces;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        if (keep[found.of_face[f]]) faces.push_back(static_cast<std::uint32_t>(f));
    return pick_faces(mesh, faces);
}

TriMesh filter_components(const TriMesh& mesh, const ComponentFilter& filter, const Progress& progress) {
    filter.check();
    const MeshComponents found = mesh_components(mesh, progress.part(0, 0.8));
    const auto shells = shells_of_cavities(mesh, found);
    std::vector<bool> keep(found.components.size());
    std::uint64_t left = filter.keep_largest.value_or(found.components.size());
    const auto passes = [&](const MeshComponent& piece) {
        return !(piece.volume_A3 && std::abs(*piece.volume_A3) < filter.min_volume_A3) &&
               piece.area_A2 >= filter.min_area_A2 && !(filter.drop_border && piece.touches_border) &&
               !(filter.drop_cavities && piece.cavity());
    };
    for (std::size_t id = 0; id < keep.size(); ++id) {
        if (shells[id] || left == 0) continue;
        keep[id] = passes(found.components[id]);
        left -= keep[id];
    }
    for (std::size_t id = 0; id < keep.size(); ++id)
        if (shells[id]) keep[id] = keep[*shells[id]] && passes(found.components[id]);
    progress.report(0.9);
    if (std::find(keep.begin(), keep.end(), false) == keep.end()) return mesh;
    return extract_components(mesh, found, keep);
}

}  // namespace vdbgeo
