#include "vdbgeo/remesh/curvature_lengths.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <optional>
#include <queue>
#include <utility>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = FaceAdjacency::none;
constexpr std::size_t grain = 256;
/// L grows by no more than this for each Å.
constexpr double grading = 0.5;

struct Estimate {
    const InputSurface& input;

    const TriMesh& mesh() const { return input.mesh(); }
    const FaceAdjacency& adjacency() const { return input.adjacency(); }
    Vec3d point(VertexId v) const { return mesh().points[v].cast<double>(); }
    bool is_free(VertexId v) const { return input.kind(v) == InputSurface::Kind::free; }

    /// Calls visit(half-edge) for those that leave v.
    template <class Visit>
    void around(VertexId v, const Visit& visit) const {
        const std::uint32_t first = adjacency().outgoing[v];
        if (first == none) return;
        std::uint32_t h = first;
        do {
            visit(h);
            h = adjacency().around(h);
        } while (h != none && h != first);
    }
    /// Calls visit(vertex) for the neighbours of v; at a border all but one.
    template <class Visit>
    void neighbours(VertexId v, const Visit& visit) const {
        around(v, [&](std::uint32_t h) { visit(mesh().triangles[h / 3][(h + 1) % 3]); });
    }
    std::vector<Vec3d> normals(int rings) const {
        std::vector<Vec3d> normal(mesh().points.size()), next(normal.size());
        parallel_for(normal.size(), grain, [&](std::size_t i) {
            Vec3d sum = Vec3d::Zero();
            around(static_cast<VertexId>(i), [&](std::uint32_t h) {
                const Triangle& t = mesh().triangles[h / 3];
                const Vec3d a = point(t[0]);
                sum += (point(t[1]) - a).cross(point(t[2]) - a);
            });
            normal[i] = sum.normalized();
        });
        for (int ring = 0; ring < rings; ++ring) {
            parallel_for(normal.size(), grain, [&](std::size_t i) {
                const VertexId v = static_cast<VertexId>(i);
                Vec3d sum = normal[i];
                if (is_free(v)) neighbours(v, [&](VertexId u) { sum += normal[u] * (is_free(u) ? 1 : 0); });
                next[i] = sum.normalized();
            });
            normal.swap(next);
        }
        return normal;
    }
    /// The vertices within two edges of v.
    void two_rings(VertexId v, std::vector<VertexId>& out) const {
        out.clear();
        neighbours(v, [&](VertexId u) {
            out.push_back(u);
            if (is_free(u)) neighbours(u, [&](VertexId w) { out.push_back(w); });
        });
        std::sort(out.begin(), out.end());
        out.erase(std::unique(out.begin(), out.end()), out.end());
    }
    /// The larger |eigenvalue| of the symmetric S for which S d ≈ Δn best, d and Δn within the tangent plane.
    double curvature(VertexId v, const std::vector<Vec3d>& normal) const {
        thread_local std::vector<VertexId> near;
        two_rings(v, near);
        const Vec3d n = normal[v], e1 = n.unitOrthogonal(), e2 = n.cross(e1), p = point(v);
        Mat3d a = Mat3d::Zero();
        Vec3d b = Vec3d::Zero();
        for (const VertexId u : near) {
            if (u == v || !is_free(u)) continue;
            const Vec3d d = point(u) - p, dn = normal[u] - n;
            const double x = d.dot(e1), y = d.dot(e2), f = dn.dot(e1), g = dn.dot(e2);
            a += (Mat3d() << x * x, x * y, 0, x * y, x * x + y * y, x * y, 0, x * y, y * y).finished();
            b += Vec3d(x * f, y * f + x * g, y * g);
        }
        const double scale = a.trace();
        if (!(scale > 0)) return 0;
        const Vec3d s = (a / scale + 1e-9 * Mat3d::Identity()).ldlt().solve(b / scale);
        const double mean = 0.5 * (s[0] + s[2]), radius = std::hypot(0.5 * (s[0] - s[2]), s[1]);
        return std::abs(mean) + radius;
    }
    /// Averages over the neighbours that are free.
    std::vector<double> smoothed(const std::vector<double>& values) const {
        std::vector<double> out(values.size());
        parallel_for(values.size(), grain, [&](std::size_t i) {
            const VertexId v = static_cast<VertexId>(i);
            double sum = is_free(v) ? values[i] : 0, count = is_free(v) ? 1 : 0;
            neighbours(v, [&](VertexId u) {
                if (is_free(u)) sum += values[u], ++count;
            });
            out[i] = count > 0 ? sum / count : 0;
        });
        return out;
    }
    /// From the shortest lengths outwards, as Dijkstra.
    void grade(std::vector<float>& lengths) const {
        using Entry = std::pair<float, VertexId>;
        std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
        for (VertexId v = 0; v < lengths.size(); ++v) queue.emplace(lengths[v], v);
        while (!queue.empty()) {
            const auto [length, v] = queue.top();
            queue.pop();
            if (length > lengths[v]) continue;
            around(v, [&](std::uint32_t h) {
                for (const VertexId u : mesh().triangles[h / 3]) {
                    const float most = static_cast<float>(length + grading * (point(u) - point(v)).norm());
                    if (most < lengths[u]) lengths[u] = most, queue.emplace(most, u);
                }
            });
        }
    }
};

}  // namespace

std::vector<float> curvature_lengths(const InputSurface& input, const CurvatureSizing& sizing) {
    const Estimate estimate{input};
    const std::vector<Vec3d> normal = estimate.normals(2);
    std::vector<double> curvature(normal.size());
    parallel_for(normal.size(), grain, [&](std::size_t i) {
        const VertexId v = static_cast<VertexId>(i);
        curvature[i] = estimate.is_free(v) ? estimate.curvature(v, normal) : 0;
    });
    curvature = estimate.smoothed(curvature);
    std::vector<float> lengths(curvature.size());
    for (std::size_t i = 0; i < lengths.size(); ++i) {
        const double squared =
            6 * sizing.error / std::max(curvature[i], 1e-30) - 3 * sizing.error * sizing.error;
        lengths[i] = static_cast<float>(
            std::clamp(std::sqrt(std::max(squared, 0.0)), sizing.min_length, sizing.max_length));
    }
    estimate.grade(lengths);
    return lengths;
}

}  // namespace vdbgeo
