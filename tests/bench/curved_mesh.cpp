#include "tests/bench/curved_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "vdbgeo/core/errors.h"

namespace vdbgeo::bench {
namespace {

/// Ring k of the upper half has 4 k vertices, that of the lower half as many as the one above it mirrored.
TriMesh split_octahedron(const CurvedShape& shape, int n) {
    TriMesh mesh;
    const auto size = [&](int ring) { return 4 * std::min(ring, 2 * n - ring); };
    std::vector<std::size_t> first;
    constexpr double x[] = {1, 0, -1, 0, 1}, y[] = {0, 1, 0, -1, 0};
    for (int ring = 0; ring <= 2 * n; ++ring) {
        first.push_back(mesh.points.size());
        const int k = size(ring) / 4;
        for (int i = 0; i < std::max(1, 4 * k); ++i) {
            const int q = k ? i / k : 0, j = k ? i % k : 0;
            const Vec3d p((k - j) * x[q] + j * x[q + 1], (k - j) * y[q] + j * y[q + 1], n - ring);
            mesh.points.push_back((shape.centre + shape.radius * p.normalized()).cast<float>());
        }
    }
    const auto id = [&](int ring, int q, int j) {
        const int count = std::max(1, size(ring));
        return static_cast<VertexId>(first[std::size_t(ring)] + std::size_t((q * (count / 4) + j) % count));
    };
    for (int ring = 0; ring < 2 * n; ++ring) {
        const bool upper = ring < n;
        const int few = upper ? ring : ring + 1, many = upper ? ring + 1 : ring, k = size(few) / 4;
        for (int q = 0; q < 4; ++q)
            for (int j = 0; j <= k; ++j) {
                Triangle out{id(few, q, j), id(many, q, j), id(many, q, j + 1)};
                if (!upper) std::swap(out[1], out[2]);
                mesh.triangles.push_back(out);
                if (j == k) continue;
                Triangle in{id(few, q, j), id(many, q, j + 1), id(few, q, j + 1)};
                if (!upper) std::swap(in[1], in[2]);
                mesh.triangles.push_back(in);
            }
    }
    return mesh;
}

TriMesh torus_grid(const CurvedShape& shape, int rows, int columns) {
    TriMesh mesh;
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) {
            const double v = 2 * M_PI * r / rows, u = 2 * M_PI * c / columns;
            const double far = shape.ring + shape.radius * std::cos(v);
            mesh.points.push_back(
                (shape.centre + Vec3d(far * std::cos(u), far * std::sin(u), shape.radius * std::sin(v)))
                    .cast<float>());
        }
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) {
            const auto id = [&](int row, int column) {
                return static_cast<VertexId>(row % rows * columns + column % columns);
            };
            mesh.triangles.push_back({id(r, c), id(r, c + 1), id(r + 1, c + 1)});
            mesh.triangles.push_back({id(r, c), id(r + 1, c + 1), id(r + 1, c)});
        }
    return mesh;
}

}  // namespace

std::pair<double, double> CurvedShape::principal(const Vec3d& p) const {
    if (ring == 0) return {1 / radius, 1 / radius};
    const Vec3d q = p - centre;
    const double out = std::hypot(q.x(), q.y()) - ring, cosine = out / std::hypot(out, q.z());
    return {1 / radius, cosine / (ring + radius * cosine)};
}

CurvedShape parse_shape(const std::string& words) {
    CurvedShape shape;
    const std::size_t at = words.find('@');
    const std::string kind = words.substr(0, at);
    int end = 0;
    const bool sphere = std::sscanf(kind.c_str(), "sphere:%lf%n", &shape.radius, &end) == 1;
    const bool good =
        sphere || std::sscanf(kind.c_str(), "torus:%lf,%lf%n", &shape.ring, &shape.radius, &end) == 2;
    bool placed = true;
    if (at != std::string::npos) {
        int used = 0;
        placed = std::sscanf(words.c_str() + at + 1, "%lf,%lf,%lf%n", &shape.centre.x(), &shape.centre.y(),
                             &shape.centre.z(), &used) == 3 &&
                 at + 1 + std::size_t(used) == words.size();
    }
    if (!good || !placed || std::size_t(end) != kind.size() || !(shape.radius > 0) || shape.ring < 0)
        throw InvalidInput("--shape is sphere:R or torus:RING,TUBE, with @X,Y,Z or without, not " + words);
    return shape;
}

TriMesh make_curved_mesh(const CurvedShape& shape, double faces) {
    if (!(faces >= 8 && faces <= 1e9)) throw InvalidInput("--faces is a number from 8 to 1e9");
    if (shape.ring == 0) return split_octahedron(shape, std::max(1, int(std::lround(std::sqrt(faces / 8)))));
    // Quads as high as they are wide where the tube is on the ring.
    const double columns = std::sqrt(faces / 2 * shape.ring / shape.radius);
    return torus_grid(shape, std::max(3, int(std::lround(faces / 2 / columns))),
                      std::max(3, int(std::lround(columns))));
}

CurvatureErrors curvature_errors(const CurvedShape& shape, const TriMesh& mesh, const Array<double>& mean,
                                 const Array<double>& gauss, const Array<std::uint8_t>& flags) {
    CurvatureErrors out;
    std::size_t count = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        if ((!flags.empty() && flags[v] != 0) || !std::isfinite(mean[v]) || !std::isfinite(gauss[v])) {
            ++out.left_out;
            continue;
        }
        const auto [k1, k2] = shape.principal(mesh.points[v].cast<double>());
        const double m = std::abs(mean[v] - 0.5 * (k1 + k2)) * shape.radius;
        const double g = std::abs(gauss[v] - k1 * k2) * shape.radius * shape.radius;
        out.mean_rms += m * m;
        out.gauss_rms += g * g;
        out.mean_max = std::max(out.mean_max, m);
        out.gauss_max = std::max(out.gauss_max, g);
        ++count;
    }
    out.mean_rms = std::sqrt(out.mean_rms / double(std::max<std::size_t>(1, count)));
    out.gauss_rms = std::sqrt(out.gauss_rms / double(std::max<std::size_t>(1, count)));
    return out;
}

}  // namespace vdbgeo::bench
