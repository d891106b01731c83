#include "vdbgeo/tet/tet_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/order_statistic.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 14;
constexpr double degrees = 180 / 3.14159265358979323846;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double radius_edge_bin = 0.05;

/// The corners that an edge of tet_edges does not have: its dihedral angle is between the faces across them.
constexpr std::array<std::array<int, 2>, 6> across{{{2, 3}, {1, 3}, {1, 2}, {0, 3}, {0, 2}, {0, 1}}};

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// A tetrahedron's shape and the lengths of its edges.
struct Measured {
    TetShape shape;
    std::array<double, 6> length;
};

Measured measure(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    const std::array<Vec3d, 6> edge{b - a, c - a, d - a, c - b, d - b, d - c};
    // Normals of twice the faces' areas, outward where the volume is positive.
    const std::array<Vec3d, 4> normal{edge[3].cross(edge[4]), edge[2].cross(edge[1]), edge[0].cross(edge[2]),
                                      edge[1].cross(edge[0])};
    Measured m;
    const double det = edge[0].cross(edge[1]).dot(edge[2]);
    m.shape.volume = det / 6;
    std::array<double, 4> area2;
    for (std::size_t k = 0; k < 4; ++k) area2[k] = normal[k].squaredNorm();
    double shortest = infinity, low = 180, high = 0;
    for (std::size_t e = 0; e < 6; ++e) {
        m.length[e] = edge[e].norm();
        shortest = std::min(shortest, m.length[e]);
        const std::size_t i = index(across[e][0]), j = index(across[e][1]);
        // |n_i × n_j| = |det| |edge|: no difference of large numbers, however flat the tetrahedron.
        const double angle = area2[i] > 0 && area2[j] > 0 ? degrees * std::atan2(std::abs(det) * m.length[e],
                                                                                 -normal[i].dot(normal[j]))
                                                          : 0;
        m.shape.dihedral_deg[e] = angle;
        low = std::min(low, angle);
        high = std::max(high, angle);
    }
    m.shape.min_dihedral_deg = low;
    m.shape.max_dihedral_deg = high;
    // The circumcentre seen from a: (|d−a|² (b−a)×(c−a) + |c−a|² (d−a)×(b−a) + |b−a|² (c−a)×(d−a)) / 2 det.
    const Vec3d centre = m.length[2] * m.length[2] * -normal[3] + m.length[1] * m.length[1] * -normal[2] +
                         m.length[0] * m.length[0] * -normal[1];
    m.shape.radius_edge = det != 0 ? centre.norm() / (2 * std::abs(det) * shortest) : infinity;
    return m;
}

Measured measure(const TetMesh& mesh, std::size_t t) {
    const Tetrahedron& v = mesh.tets[t];
    return measure(mesh.points[v[0]], mesh.points[v[1]], mesh.points[v[2]], mesh.points[v[3]]);
}

/// What is summed over the tetrahedra.
struct Sums {
    std::uint64_t inverted = 0, slivers = 0, with_ratio = 0;
    double volume = 0, min_angles = 0, ratios = 0, edges = 0;
    double min_volume = infinity, max_volume = -infinity, min_angle = 180, max_angle = 0;
    double max_ratio = 0, min_edge = infinity, max_edge = 0;
    std::map<std::int32_t, TetRegion> regions;
    std::array<std::uint64_t, 180> angle_histogram{};
    std::array<std::uint64_t, TetQuality::radius_edge_bins> ratio_histogram{};

    void add(const Measured& m);
    void add(const Sums& other);
};

void Sums::add(const Measured& m) {
    const TetShape& s = m.shape;
    inverted += !(s.volume > 0);
    slivers +=
        s.min_dihedral_deg < TetQuality::sliver_deg || s.max_dihedral_deg > 180 - TetQuality::sliver_deg;
    volume += s.volume;
    min_volume = std::min(min_volume, s.volume);
    max_volume = std::max(max_volume, s.volume);
    min_angles += s.min_dihedral_deg;
    min_angle = std::min(min_angle, s.min_dihedral_deg);
    max_angle = std::max(max_angle, s.max_dihedral_deg);
    for (const double angle : s.dihedral_deg)
        ++angle_histogram[static_cast<std::size_t>(std::min(179.0, angle))];
    for (const double length : m.length) {
        edges += length;
        min_edge = std::min(min_edge, length);
        max_edge = std::max(max_edge, length);
    }
    constexpr double last = TetQuality::radius_edge_bins - 1;
    ++ratio_histogram[static_cast<std::size_t>(std::min(last, s.radius_edge / radius_edge_bin))];
    if (!std::isfinite(s.radius_edge)) return;
    ++with_ratio;
    ratios += s.radius_edge;
    max_ratio = std::max(max_ratio, s.radius_edge);
}

void Sums::add(const Sums& other) {
    inverted += other.inverted;
    slivers += other.slivers;
    with_ratio += other.with_ratio;
    volume += other.volume;
    min_angles += other.min_angles;
    ratios += other.ratios;
    edges += other.edges;
    min_volume = std::min(min_volume, other.min_volume);
    max_volume = std::max(max_volume, other.max_volume);
    min_angle = std::min(min_angle, other.min_angle);
    max_angle = std::max(max_angle, other.max_angle);
    max_ratio = std::max(max_ratio, other.max_ratio);
    min_edge = std::min(min_edge, other.min_edge);
    max_edge = std::max(max_edge, other.max_edge);
    for (const auto& [number, part] : other.regions) {
        TetRegion& region = regions[number];
        region.tets += part.tets;
        region.volume_A3 += part.volume_A3;
    }
    for (std::size_t k = 0; k < angle_histogram.size(); ++k) angle_histogram[k] += other.angle_histogram[k];
    for (std::size_t k = 0; k < ratio_histogram.size(); ++k) ratio_histogram[k] += other.ratio_histogram[k];
}

/// Sums over all tetrahedra; the smallest angle of each goes into `min_angles`.
Sums sum_tets(const TetMesh& mesh, Array<float>& min_angles, const Progress& progress) {
    const std::size_t group = 64 * block;  // between two reports
    Sums sums;
    for (std::size_t first = 0; first < mesh.tets.size(); first += group) {
        const std::size_t count = std::min(group, mesh.tets.size() - first);
        const Sums part = fixed_order_reduce(
            count, block, Sums{},
            [&](std::size_t begin, std::size_t end) {
                Sums s;
                TetRegion* region = nullptr;
                std::int32_t number = 0;
                for (std::size_t t = first + begin; t < first + end; ++t) {
                    const Measured m = measure(mesh, t);
                    s.add(m);
                    min_angles[t] = static_cast<float>(m.shape.min_dihedral_deg);
                    if (!region || mesh.region(t) != number) region = &s.regions[number = mesh.region(t)];
                    ++region->tets;
                    region->volume_A3 += m.shape.volume;
                }
                return s;
            },
            [](Sums& all, const Sums& s) { all.add(s); });
        sums.add(part);
        progress.report(static_cast<double>(first + count) / static_cast<double>(mesh.tets.size()));
    }
    return sums;
}

float percentile(const Array<float>& values, double fraction) {
    OrderStatistic rank(fraction);
    while (!rank.done()) {
        rank.add(values.data(), values.size());
        rank.end_pass();
    }
    return rank.value();
}

MeshProperty& property(TetMesh& mesh, const char* name) {
    for (MeshProperty& p : mesh.tet_properties)
        if (p.name == name) return p;
    return mesh.tet_properties.emplace_back(MeshProperty{name, 1, {}});
}

}  // namespace

TetShape tet_shape(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    return measure(a, b, c, d).shape;
}

TetQuality measure_tets(const TetMesh& mesh, const Progress& progress) {
    check(mesh, "mesh");
    TetQuality q;
    q.vertices = mesh.points.size();
    q.tets = mesh.tets.size();
    q.boundary_faces = static_cast<std::uint64_t>(std::count_if(
        mesh.face_regions.begin(), mesh.face_regions.end(), [](const auto& r) { return r[1] == 0; }));
    if (mesh.empty()) return q;
    Array<float> min_angles(mesh.tets.size());
    const Sums sums = sum_tets(mesh, min_angles, progress);
    const double n = static_cast<double>(q.tets);
    q.inverted = sums.inverted;
    q.slivers = sums.slivers;
    q.volume_A3 = sums.volume;
    q.min_volume_A3 = sums.min_volume;
    q.max_volume_A3 = sums.max_volume;
    q.min_dihedral_deg = sums.min_angle;
    q.max_dihedral_deg = sums.max_angle;
    q.mean_min_dihedral_deg = sums.min_angles / n;
    q.min_dihedral_p01_deg = static_cast<double>(percentile(min_angles, 0.01));
    q.radius_edge_max = sums.max_ratio;
    q.radius_edge_mean = sums.with_ratio ? sums.ratios / static_cast<double>(sums.with_ratio) : 0;
    q.mean_edge_A = sums.edges / (6 * n);
    q.min_edge_A = sums.min_edge;
    q.max_edge_A = sums.max_edge;
    for (const auto& [number, region] : sums.regions) {
        q.regions.push_back(region);
        q.regions.back().region = number;
    }
    q.dihedral_histogram = sums.angle_histogram;
    q.radius_edge_histogram = sums.ratio_histogram;
    return q;
}

void set_quality_properties(TetMesh& mesh) {
    const std::size_t n = mesh.tets.size();
    // All four first: the list may move while it grows.
    for (const char* name : {"min_dihedral_deg", "max_dihedral_deg", "radius_edge", "volume_A3"}) {
        MeshProperty& p = property(mesh, name);
        p.components = 1;
        p.values.resize(n);
    }
    float* low = property(mesh, "min_dihedral_deg").values.data();
    float* high = property(mesh, "max_dihedral_deg").values.data();
    float* ratio = property(mesh, "radius_edge").values.data();
    float* volume = property(mesh, "volume_A3").values.data();
    parallel_for(n, 4096, [&](std::size_t t) {
        const TetShape s = measure(mesh, t).shape;
        low[t] = static_cast<float>(s.min_dihedral_deg);
        high[t] = static_cast<float>(s.max_dihedral_deg);
        ratio[t] = static_cast<float>(s.radius_edge);
        volume[t] = static_cast<float>(s.volume);
    });
}

}  // namespace vdbgeo
