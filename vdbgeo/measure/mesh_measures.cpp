#include "vdbgeo/measure/mesh_measures.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "vdbgeo/core/disjoint_sets.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 14;
constexpr double degrees = 180 / 3.14159265358979323846;

constexpr double first_ratio = 0.5, ratio_bins_per_unit = 20;

struct Sums {
    double area = 0, cap_area = 0, volume = 0, angles = 0, min_angle = 180, max_angle = 0;
    double ratios = 0, max_ratio = 0;
    std::uint64_t flat_faces = 0;
    std::array<std::uint64_t, 180> histogram{};
    std::array<std::uint64_t, 40> ratio_histogram{};
};

/// The mean of the faces' corners: points that no face uses may lie anywhere.
Vec3d centre_of(const TriMesh& mesh) {
    const Vec3d sum = fixed_order_reduce(
        mesh.triangles.size(), block, Vec3d(Vec3d::Zero()),
        [&](std::size_t begin, std::size_t end) {
            Vec3d s = Vec3d::Zero();
            for (std::size_t f = begin; f < end; ++f)
                for (const VertexId v : mesh.triangles[f]) s += mesh.points[v].cast<double>();
            return s;
        },
        [](Vec3d& all, const Vec3d& part) { all += part; });
    return sum / (3 * static_cast<double>(mesh.triangles.size()));
}

void add_angle(Sums& sums, double angle) {
    sums.angles += angle;
    sums.min_angle = std::min(sums.min_angle, angle);
    sums.max_angle = std::max(sums.max_angle, angle);
    ++sums.histogram[static_cast<std::size_t>(std::min(179.0, angle))];
}

void add_ratio(Sums& sums, double ratio) {
    sums.ratios += ratio;
    sums.max_ratio = std::max(sums.max_ratio, ratio);
    const double last = static_cast<double>(sums.ratio_histogram.size() - 1);
    ++sums.ratio_histogram[static_cast<std::size_t>(
        std::clamp((ratio - first_ratio) * ratio_bins_per_unit, 0.0, last))];
}

void add_face(Sums& sums, const std::array<Vec3d, 3>& p, const Vec3d& centre, bool cap) {
    // Differences of floats are exact in double; those of centred points are not, and needles would show it.
    const Vec3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    const double twice_area = normal.norm();
    (cap ? sums.cap_area : sums.area) += 0.5 * twice_area;
    sums.volume += (p[0] - centre).dot(normal) / 6;
    if (twice_area == 0) {
        for (const double angle : {0.0, 0.0, 180.0}) add_angle(sums, angle);
        ++sums.flat_faces;
        ++sums.ratio_histogram.back();
        return;
    }
    std::array<double, 3> squared;  // of the side across each corner
    for (std::size_t k = 0; k < 3; ++k) squared[k] = (p[(k + 2) % 3] - p[(k + 1) % 3]).squaredNorm();
    const auto widest =
        static_cast<std::size_t>(std::max_element(squared.begin(), squared.end()) - squared.begin());
    double rest = 180;  // the widest angle is what the sharp ones, which are exact, leave
    for (std::size_t k = 0; k < 3; ++k) {
        if (k == widest) continue;
        const double angle =
            degrees * std::atan2(twice_area, (p[(k + 1) % 3] - p[k]).dot(p[(k + 2) % 3] - p[k]));
        add_angle(sums, angle);
        rest -= angle;
    }
    add_angle(sums, rest);
    std::sort(squared.begin(), squared.end());
    add_ratio(sums, std::sqrt(squared[1]) * std::sqrt(squared[2]) / (2 * twice_area));
}

Sums sum_faces(const TriMesh& mesh) {
    const Vec3d centre = centre_of(mesh);
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    const auto is_cap = [&](std::size_t f) {
        return caps && caps->values[f * static_cast<std::size_t>(caps->components)] > 0.5f;
    };
    return fixed_order_reduce(
        mesh.triangles.size(), block, Sums{},
        [&](std::size_t begin, std::size_t end) {
            Sums s;
            for (std::size_t f = begin; f < end; ++f) {
                std::array<Vec3d, 3> p;
                for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[mesh.triangles[f][k]].cast<double>();
                add_face(s, p, centre, is_cap(f));
            }
            return s;
        },
        [](Sums& all, const Sums& part) {
            all.area += part.area;
            all.cap_area += part.cap_area;
            all.ratios += part.ratios;
            all.max_ratio = std::max(all.max_ratio, part.max_ratio);
            all.flat_faces += part.flat_faces;
            for (std::size_t k = 0; k < all.ratio_histogram.size(); ++k)
                all.ratio_histogram[k] += part.ratio_histogram[k];
            all.volume += part.volume;
            all.angles += part.angles;
            all.min_angle = std::min(all.min_angle, part.min_angle);
            all.max_angle = std::max(all.max_angle, part.max_angle);
            for (std::size_t k = 0; k < all.histogram.size(); ++k) all.histogram[k] += part.histogram[k];
        });
}

/// One end of a boundary edge.
struct BorderEnd {
    VertexId vertex, other;
    std::uint32_t fan;  // of the vertex
};

struct Counts {
    std::uint64_t used = 0, edges = 0, boundary = 0, non_manifold = 0, misoriented = 0, duplicates = 0,
                  split_vertices = 0;
    std::vector<BorderEnd> border;
};

/// How many faces of an edge have the same third vertex as one before them, where that is the face's highest
/// vertex: so each face is looked at at one of its edges.
std::uint64_t duplicates_at(const TriMesh& mesh, const VertexStar& star, const VertexStar::Spoke* first,
                            const VertexStar::Spoke* last) {
    const VertexId v = star.vertex(), other = first->other;
    if (last - first < 2 || v > other) return 0;
    const auto apex = [&](const VertexStar::Spoke& s) {
        const Triangle& t = mesh.triangles[star.face(s.slot)];
        return t[(corner_of(t, v) + (s.out ? 2u : 1u)) % 3];
    };
    if (last - first == 2) return apex(first[0]) == apex(first[1]) && apex(first[0]) > other;
    std::vector<VertexId> tops;
    for (const VertexStar::Spoke* s = first; s != last; ++s)
        if (apex(*s) > other) tops.push_back(apex(*s));
    std::sort(tops.begin(), tops.end());
    return static_cast<std::uint64_t>(tops.end() - std::unique(tops.begin(), tops.end()));
}

void count_star(const TriMesh& mesh, VertexStar& star, Counts& counts) {
    const VertexId v = star.vertex();
    ++counts.used;
    bool border = false;
    star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
        const auto faces = last - first;
        border |= faces == 1;
        for (const VertexStar::Spoke* s = first + 1; s < last; ++s) star.join(first->slot, s->slot);
        if (v > first->other) return;
        ++counts.edges;
        counts.boundary += faces == 1;
        counts.non_manifold += faces > 2;
        counts.misoriented += faces == 2 && first[0].out == first[1].out;
        counts.duplicates += duplicates_at(mesh, star, first, last);
    });
    counts.split_vertices += star.fan_count() > 1;
    if (!border) return;
    star.for_each_edge([&](const VertexStar::Spoke* first, const VertexStar::Spoke* last) {
        if (last - first == 1) counts.border.push_back({v, first->other, star.fan(first->slot)});
    });
}

Counts count_stars(const TriMesh& mesh) {
    const VertexFaces faces(mesh);
    return fixed_order_reduce(
        mesh.points.size(), block, Counts{},
        [&](std::size_t begin, std::size_t end) {
            Counts counts;
            VertexStar star;
            for (std::size_t v = begin; v < end; ++v) {
                star.fill(mesh, faces, static_cast<VertexId>(v));
                if (star.face_count() > 0) count_star(mesh, star, counts);
            }
            return counts;
        },
        [](Counts& all, const Counts& part) {
            all.used += part.used;
            all.edges += part.edges;
            all.boundary += part.boundary;
            all.non_manifold += part.non_manifold;
            all.misoriented += part.misoriented;
            all.duplicates += part.duplicates;
            all.split_vertices += part.split_vertices;
            all.border.insert(all.border.end(), part.border.begin(), part.border.end());
        });
}

/// The ends come vertex by vertex. Those of one edge belong together, and those in one fan of a vertex.
std::uint64_t count_loops(const std::vector<BorderEnd>& ends) {
    DisjointSets loops(ends.size());
    std::vector<std::uint32_t> order(ends.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto join_equal = [&](const auto& key) {
        std::sort(order.begin(), order.end(),
                  [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
        for (std::size_t i = 1; i < order.size(); ++i)
            if (key(order[i]) == key(order[i - 1])) loops.join(order[i], order[i - 1]);
    };
    join_equal([&](std::uint32_t i) { return std::minmax(ends[i].vertex, ends[i].other); });
    join_equal([&](std::uint32_t i) { return std::make_pair(ends[i].vertex, ends[i].fan); });
    std::uint64_t count = 0;
    for (std::uint32_t i = 0; i < ends.size(); ++i) count += loops.find(i) == i;
    return count;
}

void count_topology(const TriMesh& mesh, MeshMeasures& m) {
    const Counts counts = count_stars(mesh);
    m.edges = counts.edges;
    m.boundary_edges = counts.boundary;
    m.non_manifold_edges = counts.non_manifold;
    m.misoriented_edges = counts.misoriented;
    m.duplicate_faces = counts.duplicates;
    m.non_manifold_vertices = counts.split_vertices;
    m.holes = count_loops(counts.border);
    m.unused_vertices = m.vertices - counts.used;
    DisjointSets pieces(mesh.points.size());
    std::uint64_t joints = 0;  // each takes one piece away
    for (const Triangle& t : mesh.triangles) {
        m.degenerate_faces += degenerate(t);
        if (degenerate(t)) continue;
        for (const VertexId other : {t[1], t[2]}) {
            if (pieces.find(t[0]) == pieces.find(other)) continue;
            pieces.join(t[0], other);
            ++joints;
        }
    }
    m.components = counts.used - joints;
    m.euler_characteristic = static_cast<std::int64_t>(counts.used) - static_cast<std::int64_t>(m.edges) +
                             static_cast<std::int64_t>(m.faces - m.degenerate_faces);
}

}  // namespace

MeshMeasures measure_mesh(const TriMesh& mesh, const Progress& progress) {
    check(mesh, "mesh");
    MeshMeasures m;
    m.vertices = mesh.points.size();
    m.faces = mesh.triangles.size();
    count_topology(mesh, m);
    progress.report(0.8);
    m.closed = m.faces > m.degenerate_faces && m.boundary_edges == 0 && m.non_manifold_edges == 0;
    m.oriented = m.misoriented_edges == 0;
    m.manifold = m.non_manifold_edges == 0 && m.non_manifold_vertices == 0 && m.degenerate_faces == 0;
    if (m.closed && m.manifold && m.oriented)
        m.genus = (2 * static_cast<std::int64_t>(m.components) - m.euler_characteristic) / 2;
    if (m.faces == 0) return m;
    const Sums sums = sum_faces(mesh);
    m.area_A2 = sums.area;
    m.cap_area_A2 = sums.cap_area;
    if (m.closed && m.oriented) m.volume_A3 = sums.volume;
    m.min_angle_deg = sums.min_angle;
    m.max_angle_deg = sums.max_angle;
    m.mean_angle_deg = sums.angles / (3 * static_cast<double>(m.faces));
    m.angle_histogram = sums.histogram;
    m.angles_below_30_fraction = static_cast<double>(std::accumulate(
                                     sums.histogram.begin(), sums.histogram.begin() + 30, std::uint64_t(0))) /
                                 (3 * static_cast<double>(m.faces));
    m.radius_edge_max = sums.max_ratio;
    if (m.faces > sums.flat_faces)
        m.radius_edge_mean = sums.ratios / static_cast<double>(m.faces - sums.flat_faces);
    m.radius_edge_histogram = sums.ratio_histogram;
    progress.report(1);
    return m;
}

}  // namespace vdbgeo
