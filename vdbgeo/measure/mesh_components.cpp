#include "vdbgeo/measure/mesh_components.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <numeric>

#include "vdbgeo/core/disjoint_sets.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

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

/// The places where rays along +x start, in bins over y and z.
class RayBins {
 public:
    RayBins(const std::vector<Vec3f>& starts) {
        low_ = high_ = starts.front().tail<2>().cast<double>();
        for (const Vec3f& p : starts) {
            low_ = low_.cwiseMin(p.tail<2>().cast<double>());
            high_ = high_.cwiseMax(p.tail<2>().cast<double>());
        }
        const Eigen::Vector2d extent = high_ - low_;
        const double side = std::sqrt(static_cast<double>(starts.size()));
        for (const int a : {0, 1}) {
            count_[a] = std::max<std::int64_t>(1, static_cast<std::int64_t>(side));
            scale_[a] = extent[a] > 0 ? static_cast<double>(count_[a]) / extent[a] : 0;
        }
        first_.assign(static_cast<std::size_t>(count_[0] * count_[1]) + 1, 0);
        for (const Vec3f& p : starts) ++first_[bin(p) + 1];
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        rays_.resize(starts.size());
        std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
        for (std::uint32_t i = 0; i < starts.size(); ++i) rays_[next[bin(starts[i])]++] = i;
    }

    /// Calls visit(ray) for the rays in the bins that a box over y and z meets.
    template <class Visit>
    void visit(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const Visit& visit) const {
        if ((high.array() < low_.array()).any() || (low.array() > high_.array()).any()) return;
        for (std::int64_t z = row(low[1], 1); z <= row(high[1], 1); ++z)
            for (std::int64_t y = row(low[0], 0); y <= row(high[0], 0); ++y) {
                const auto b = static_cast<std::size_t>(z * count_[0] + y);
                for (std::uint32_t i = first_[b]; i < first_[b + 1]; ++i) visit(rays_[i]);
            }
    }

 private:
    std::int64_t row(double x, int a) const {
        const double at = (x - low_[a]) * scale_[a];
        return static_cast<std::int64_t>(std::clamp(at, 0.0, static_cast<double>(count_[a] - 1)));
    }
    std::size_t bin(const Vec3f& p) const {
        return static_cast<std::size_t>(row(double(p.z()), 1) * count_[0] + row(double(p.y()), 0));
    }

    Eigen::Vector2d low_, high_;
    double scale_[2];
    std::int64_t count_[2];
    std::vector<std::uint32_t> first_, rays_;
};

/// Twice the signed area of (a, b, p) over y and z. The products of differences of floats are exact for
/// coordinates of like size, so the sign is.
double turn(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
    return (b.y() - a.y()) * (p.z() - a.z()) - (b.z() - a.z()) * (p.y() - a.y());
}

/// The x at which a ray along +x from p leaves the solid behind a face; its rim belongs to the face.
std::optional<double> leaves_at(const std::array<Vec3d, 3>& t, const Vec3d& p) {
    const double a = turn(t[1], t[2], p), b = turn(t[2], t[0], p), c = turn(t[0], t[1], p);
    if (a < 0 || b < 0 || c < 0 || a + b + c <= 0) return std::nullopt;
    const double x = (a * t[0].x() + b * t[1].x() + c * t[2].x()) / (a + b + c);
    if (x <= p.x()) return std::nullopt;
    return x;
}

struct Hit {
    double x = std::numeric_limits<double>::infinity();
    std::uint32_t piece = none;
};

std::vector<Hit> first_hits(const TriMesh& mesh, const std::vector<std::uint32_t>& of_face,
                            const std::vector<Vec3f>& starts, const std::vector<std::uint32_t>& own) {
    const RayBins bins(starts);
    std::vector<Hit> hits(starts.size());
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        std::array<Vec3d, 3> p;
        for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[mesh.triangles[f][k]].cast<double>();
        if (turn(p[0], p[1], p[2]) <= 0) continue;
        const Vec3d low = p[0].cwiseMin(p[1]).cwiseMin(p[2]), high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
        bins.visit(low.tail<2>(), high.tail<2>(), [&](std::uint32_t ray) {
            if (own[ray] == of_face[f] || high.x() <= double(starts[ray].x()) || low.x() > hits[ray].x)
                return;
            const std::optional<double> x = leaves_at(p, starts[ray].cast<double>());
            if (!x || *x > hits[ray].x || (*x == hits[ray].x && of_face[f] > hits[ray].piece)) return;
            hits[ray] = {*x, of_face[f]};
        });
    }
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
    std::vector<Vec3f> starts(cavities.size(), Vec3f::Constant(-std::numeric_limits<float>::infinity()));
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        if (ray_of[found.of_face[f]] == none) continue;
        Vec3f& start = starts[ray_of[found.of_face[f]]];
        for (const VertexId v : mesh.triangles[f])
            if (mesh.points[v].x() > start.x()) start = mesh.points[v];
    }
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
    std::vector<std::uint32_t> place(mesh.points.size(), none), faces;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        if (!keep[found.of_face[f]]) continue;
        faces.push_back(static_cast<std::uint32_t>(f));
        for (const VertexId v : mesh.triangles[f]) place[v] = 0;
    }
    std::vector<std::uint32_t> vertices;
    for (std::size_t v = 0; v < place.size(); ++v) {
        if (place[v] == none) continue;
        place[v] = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(static_cast<std::uint32_t>(v));
    }
    TriMesh kept;
    kept.points.reserve(vertices.size());
    for (const std::uint32_t v : vertices) kept.points.push_back(mesh.points[v]);
    kept.triangles.reserve(faces.size());
    for (const std::uint32_t f : faces) {
        const Triangle& t = mesh.triangles[f];
        kept.triangles.push_back({place[t[0]], place[t[1]], place[t[2]]});
    }
    const auto pick = [](const std::vector<MeshProperty>& from, const std::vector<std::uint32_t>& elements) {
        std::vector<MeshProperty> picked;
        for (const MeshProperty& p : from) {
            const auto n = static_cast<std::size_t>(p.components);
            MeshProperty q{p.name, p.components, {}};
            q.values.reserve(n * elements.size());
            for (const std::size_t e : elements)
                for (std::size_t c = 0; c < n; ++c) q.values.push_back(p.values[n * e + c]);
            picked.push_back(std::move(q));
        }
        return picked;
    };
    kept.vertex_properties = pick(mesh.vertex_properties, vertices);
    kept.face_properties = pick(mesh.face_properties, faces);
    return kept;
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
