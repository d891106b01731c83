#include "vdbgeo/measure/mesh_measures.h"

#include <tbb/parallel_sort.h>

#include <cmath>
#include <numeric>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 1 << 14;
constexpr double degrees = 180 / 3.14159265358979323846;

/// Disjoint sets by path halving.
class DisjointSets {
 public:
    explicit DisjointSets(std::size_t count) : parent_(count) {
        std::iota(parent_.begin(), parent_.end(), 0u);
    }
    std::uint64_t find(std::uint64_t i) {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    void join(std::uint64_t a, std::uint64_t b) {
        a = find(a);
        b = find(b);
        parent_[std::max(a, b)] = std::min(a, b);
    }

 private:
    std::vector<std::uint64_t> parent_;
};

/// One side of a face: the edge's two vertices packed with the lower first, and where it comes from.
struct Side {
    std::uint64_t edge;
    std::uint64_t corner;  // 3 · face + the corner that the side starts at
    bool operator<(const Side& o) const { return edge != o.edge ? edge < o.edge : corner < o.corner; }
};

struct Sums {
    Vec3d first_moment = Vec3d::Zero();
    double area = 0, volume = 0, angles = 0, min_angle = 180, max_angle = 0;
    std::array<std::uint64_t, 180> histogram{};
};

bool degenerate(const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

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

void add_face(Sums& sums, const std::array<Vec3d, 3>& p, const Vec3d& centre) {
    // Differences of floats are exact in double; those of centred points are not, and needles would show it.
    const Vec3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    const double twice_area = normal.norm();
    sums.area += 0.5 * twice_area;
    sums.volume += (p[0] - centre).dot(normal) / 6;
    if (twice_area == 0) {
        for (const double angle : {0.0, 0.0, 180.0}) add_angle(sums, angle);
        return;
    }
    for (std::size_t k = 0; k < 3; ++k)
        add_angle(sums, degrees * std::atan2(twice_area, (p[(k + 1) % 3] - p[k]).dot(p[(k + 2) % 3] - p[k])));
}

Sums sum_faces(const TriMesh& mesh) {
    const Vec3d centre = centre_of(mesh);
    return fixed_order_reduce(
        mesh.triangles.size(), block, Sums{},
        [&](std::size_t begin, std::size_t end) {
            Sums s;
            for (std::size_t f = begin; f < end; ++f) {
                std::array<Vec3d, 3> p;
                for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[mesh.triangles[f][k]].cast<double>();
                add_face(s, p, centre);
            }
            return s;
        },
        [](Sums& all, const Sums& part) {
            all.area += part.area;
            all.volume += part.volume;
            all.angles += part.angles;
            all.min_angle = std::min(all.min_angle, part.min_angle);
            all.max_angle = std::max(all.max_angle, part.max_angle);
            for (std::size_t k = 0; k < all.histogram.size(); ++k) all.histogram[k] += part.histogram[k];
        });
}

constexpr std::uint64_t no_edge = ~std::uint64_t(0);  // sorts last; no vertex has the number 2^32 - 1

/// The sides of all faces, edge by edge; those of degenerate faces come last, as no_edge.
Array<Side> sorted_sides(const TriMesh& mesh) {
    Array<Side> sides(3 * mesh.triangles.size());
    parallel_for(mesh.triangles.size(), block, [&](std::size_t f) {
        const Triangle& t = mesh.triangles[f];
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint64_t a = t[k], b = t[(k + 1) % 3];
            const std::uint64_t edge = degenerate(t) ? no_edge : std::min(a, b) << 32 | std::max(a, b);
            sides[3 * f + k] = {edge, 3 * f + k};
        }
    });
    tbb::parallel_sort(sides.begin(), sides.end());
    return sides;
}

/// Counts the edges by their number of faces, and joins the corners that lie side by side in a vertex's fan.
void visit_edges(const TriMesh& mesh, MeshMeasures& m, DisjointSets& fans) {
    const Array<Side> sides = sorted_sides(mesh);
    const auto corner_at = [&](std::uint64_t corner, VertexId v) {
        const std::uint64_t face = corner / 3;
        for (std::uint64_t k = 0; k < 3; ++k)
            if (mesh.triangles[face][k] == v) return 3 * face + k;
        return corner;
    };
    for (std::size_t begin = 0, end; begin < sides.size() && sides[begin].edge != no_edge; begin = end) {
        for (end = begin; end < sides.size() && sides[end].edge == sides[begin].edge; ++end) {
        }
        ++m.edges;
        const std::size_t faces = end - begin;
        m.boundary_edges += faces == 1;
        m.non_manifold_edges += faces > 2;
        const auto low = static_cast<VertexId>(sides[begin].edge >> 32),
                   high = static_cast<VertexId>(sides[begin].edge);
        const auto starts_low = [&](std::size_t i) {
            return mesh.triangles[sides[i].corner / 3][sides[i].corner % 3] == low;
        };
        if (faces == 2 && starts_low(begin) == starts_low(begin + 1)) ++m.misoriented_edges;
        for (std::size_t i = begin + 1; i < end; ++i)
            for (const VertexId v : {low, high})
                fans.join(corner_at(sides[begin].corner, v), corner_at(sides[i].corner, v));
    }
}

void count_topology(const TriMesh& mesh, MeshMeasures& m) {
    const std::size_t corners = 3 * mesh.triangles.size();
    DisjointSets fans(corners), pieces(mesh.points.size());
    visit_edges(mesh, m, fans);
    std::vector<std::uint8_t> used(mesh.points.size(), 0), fans_of(mesh.points.size(), 0);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        if (degenerate(t)) {
            ++m.degenerate_faces;
            continue;
        }
        for (std::size_t k = 0; k < 3; ++k) {
            used[t[k]] = 1;
            pieces.join(t[0], t[k]);
            if (fans.find(3 * f + k) == 3 * f + k && fans_of[t[k]] < 2) ++fans_of[t[k]];
        }
    }
    std::uint64_t used_count = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        used_count += used[v];
        m.components += used[v] && pieces.find(v) == v;
        m.non_manifold_vertices += fans_of[v] > 1;
    }
    m.unused_vertices = m.vertices - used_count;
    m.euler_characteristic = static_cast<std::int64_t>(used_count) - static_cast<std::int64_t>(m.edges) +
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
    if (m.closed && m.oriented) m.volume_A3 = sums.volume;
    m.min_angle_deg = sums.min_angle;
    m.max_angle_deg = sums.max_angle;
    m.mean_angle_deg = sums.angles / (3 * static_cast<double>(m.faces));
    m.angle_histogram = sums.histogram;
    progress.report(1);
    return m;
}

}  // namespace vdbgeo
