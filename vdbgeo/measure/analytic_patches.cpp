#include "vdbgeo/measure/analytic_patches.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_builder.h"

namespace vdbgeo {
namespace {

/// Candidates for the floats of a vertex.
constexpr int candidates = 1000;
/// How far they are from its place in the lattice, as a part of an edge: a regular lattice is to stay one.
constexpr double reach_regular = 1e-5, reach_moved = 1e-3;
/// What one-ring curvature loses by a vertex off the surface by δ, and by one that slides along it by s out
/// of a regular lattice, at edges e and curvatures of 1/Å: about 4 δ/e² and 0.6 s/e (in 1/Å).
constexpr double loss_off = 4, loss_along = 0.6;
/// A loss that is small enough.
constexpr double loss_accepted = 1e-7;

/// The square of a profile ρ(y) that is turned around the y axis, with its derivatives by y.
struct Profile {
    double g, d1, d2;
};

Profile squared(double rho, double d1, double d2) {
    return {rho * rho, 2 * rho * d1, 2 * (d1 * d1 + rho * d2)};
}

/// z = √(g(y) − x²) − √g(0).
GraphPoint turned(const Profile& p, double neck, double x) {
    const double w = std::sqrt(p.g - x * x), w3 = w * w * w;
    return {w - neck,
            -x / w,
            p.d1 / (2 * w),
            -1 / w - x * x / w3,
            x * p.d1 / (2 * w3),
            p.d2 / (2 * w) - p.d1 * p.d1 / (4 * w3)};
}

GraphPoint upside_down(const GraphPoint& p) { return {-p.z, -p.fx, -p.fy, -p.fxx, -p.fxy, -p.fyy}; }

GraphPoint quadratic(double a, double b, double x, double y) {
    return {0.5 * (a * x * x + b * y * y), a * x, b * y, a, 0, b};
}

/// Radii of the torus. With a tube of 1 the errors at its inner side would be twice those of the other
/// shapes.
constexpr double torus_ring = 2.6, torus_tube = 1.3;

/// The torus around the y axis; `side` is 1 outside, −1 inside.
GraphPoint torus(double side, double x, double y) {
    const double r = torus_tube, q = std::sqrt(r * r - y * y);
    const GraphPoint p = turned(squared(torus_ring + side * q, -side * y / q, -side * r * r / (q * q * q)),
                                torus_ring + side * r, x);
    return side > 0 ? p : upside_down(p);
}

double torus_distance(double x, double y, double axial) {
    return torus_tube - std::hypot(std::hypot(x, axial) - torus_ring, y);
}

/// Place of a vertex in the lattice with edges of 1, moved by the pattern.
Eigen::Vector2d lattice_place(int i, int j, double jitter) {
    // Nine offsets in −1…1, of which no two neighbours' are alike.
    static constexpr double pattern[9][2] = {{0.9, -0.4},  {-0.7, 0.8}, {0.1, -0.9}, {-0.3, 0.5}, {0.6, 0.9},
                                             {-1.0, -0.6}, {0.4, 0.2},  {1.0, -0.2}, {-0.8, -0.3}};
    const int k = 3 * (((i % 3) + 3) % 3) + ((j % 3) + 3) % 3;
    return {i + 0.5 * j + jitter * pattern[k][0], std::sqrt(0.75) * j + jitter * pattern[k][1]};
}

/// The point near (x, y) with coordinates that are floats at which the least is lost.
Vec3f on_surface(const AnalyticPatchOptions& o, const Eigen::Vector2d& place, double edge) {
    const double reach = edge * (o.jitter > 0 ? reach_moved : reach_regular);
    const double along_weight = o.jitter > 0 ? 0 : loss_along / edge;
    Vec3f best = Vec3f::Zero();
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < candidates && least > loss_accepted; ++k) {
        // A sequence that fills the square evenly (the plastic number's); the first is the place itself.
        const double u = 0.7548776662466927 * k, v = 0.5698402909980532 * k;
        const Eigen::Vector2d wanted =
            place + 2 * reach * Eigen::Vector2d(u - std::round(u), v - std::round(v));
        const Eigen::Vector2f at = wanted.cast<float>();
        const double z = graph_point(o.shape, at.x(), at.y()).z;
        const float rounded = static_cast<float>(z);
        const double lost = loss_off * std::abs(z - rounded) / (edge * edge) +
                            along_weight * (at.cast<double>() - place).norm();
        if (lost < least) {
            least = lost;
            best = Vec3f(at.x(), at.y(), rounded);
        }
    }
    return best;
}

/// A hexagon of `rings` rings of lattice vertices.
struct Hexagon {
    int rings;
    std::vector<std::pair<int, int>> places;
    Array<Triangle> triangles;

    explicit Hexagon(int n) : rings(n) {
        std::vector<VertexId> ids(static_cast<std::size_t>((2 * n + 1) * (2 * n + 1)));
        const auto id = [&](int i, int j) -> VertexId& {
            return ids[static_cast<std::size_t>((j + n) * (2 * n + 1) + i + n)];
        };
        const auto inside = [n](int i, int j) {
            return std::max({std::abs(i), std::abs(j), std::abs(i + j)}) <= n;
        };
        for (int j = -n; j <= n; ++j)
            for (int i = -n; i <= n; ++i)
                if (inside(i, j)) {
                    id(i, j) = static_cast<VertexId>(places.size());
                    places.emplace_back(i, j);
                }
        for (const auto& [i, j] : places) {
            if (!inside(i + 1, j)) continue;
            if (inside(i, j + 1)) triangles.push_back({id(i, j), id(i + 1, j), id(i, j + 1)});
            if (inside(i + 1, j - 1)) triangles.push_back({id(i, j), id(i + 1, j - 1), id(i + 1, j)});
        }
    }
};

/// Longest edge at vertices within the radius of the z axis.
template <class Points>
double longest_edge(const Points& points, const Array<Triangle>& triangles, double radius) {
    double longest = 0;
    for (const Triangle& t : triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3d a = points[t[k]].template cast<double>();
            const Vec3d b = points[t[(k + 1) % 3]].template cast<double>();
            if (std::min(a.head<2>().norm(), b.head<2>().norm()) <= radius)
                longest = std::max(longest, (a - b).norm());
        }
    return longest;
}

/// The vertices of the lattice of this step on the surface, before anything is rounded.
std::vector<Vec3d> exact_points(const Hexagon& hexagon, const AnalyticPatchOptions& o, double step) {
    std::vector<Vec3d> points;
    points.reserve(hexagon.places.size());
    for (const auto& [i, j] : hexagon.places) {
        const Eigen::Vector2d at = step * lattice_place(i, j, o.jitter);
        points.emplace_back(at.x(), at.y(), graph_point(o.shape, at.x(), at.y()).z);
    }
    return points;
}

}  // namespace

const char* name_of(PatchShape shape) {
    static constexpr const char* names[] = {"peak",    "pit",           "ridge",
                                            "valley",  "saddle ridge",  "saddle valley",
                                            "minimal", "torus outside", "torus inside"};
    return names[static_cast<int>(shape)];
}

GraphPoint graph_point(PatchShape shape, double x, double y) {
    switch (shape) {
        case PatchShape::peak:
            return turned({1 - y * y, -2 * y, -2}, 1, x);
        case PatchShape::pit:
            return upside_down(graph_point(PatchShape::peak, x, y));
        case PatchShape::ridge:
            return turned({1, 0, 0}, 1, x);
        case PatchShape::valley:
            return upside_down(graph_point(PatchShape::ridge, x, y));
        case PatchShape::saddle_ridge:
            return quadratic(-0.8, 0.4, x, y);
        case PatchShape::saddle_valley:
            return quadratic(0.8, -0.4, x, y);
        case PatchShape::minimal:
            return turned(squared(std::cosh(y), std::sinh(y), std::cosh(y)), 1, x);
        case PatchShape::torus_outside:
            return torus(1, x, y);
        case PatchShape::torus_inside:
            return torus(-1, x, y);
    }
    throw InvalidInput("graph_point: no such shape");
}

double patch_field(PatchShape shape, const Vec3d& p) {
    const double x = p.x(), y = p.y(), z = p.z();
    switch (shape) {
        case PatchShape::peak:
            return 1 - std::hypot(x, y, z + 1);
        case PatchShape::pit:
            return std::hypot(x, y, z - 1) - 1;
        case PatchShape::ridge:
            return 1 - std::hypot(x, z + 1);
        case PatchShape::valley:
            return std::hypot(x, z - 1) - 1;
        case PatchShape::saddle_ridge:
        case PatchShape::saddle_valley:
            return graph_point(shape, x, y).z - z;
        case PatchShape::minimal:
            return std::cosh(y) - std::hypot(x, z + 1);
        case PatchShape::torus_outside:
            return torus_distance(x, y, z + torus_ring + torus_tube);
        case PatchShape::torus_inside:
            return torus_distance(x, y, z - (torus_ring - torus_tube));
    }
    throw InvalidInput("patch_field: no such shape");
}

void set_graph_curvature(Curvatures& curvature, std::size_t v, const GraphPoint& p) {
    // Shape operator I⁻¹ II in the basis (1, 0, fx), (0, 1, fy); minus: the specimen is below.
    const double w2 = 1 + p.fx * p.fx + p.fy * p.fy, w = std::sqrt(w2);
    const double gaussian = (p.fxx * p.fyy - p.fxy * p.fxy) / (w2 * w2);
    const double mean =
        -((1 + p.fy * p.fy) * p.fxx - 2 * p.fx * p.fy * p.fxy + (1 + p.fx * p.fx) * p.fyy) / (2 * w2 * w);
    const double root = std::sqrt(std::max(0.0, mean * mean - gaussian));
    // An orthonormal tangent frame, e1 along (1, 0, fx); the second form in it.
    const double a = std::sqrt(1 + p.fx * p.fx);
    const Vec3d e1 = Vec3d(1, 0, p.fx) / a;
    const Vec3d e2 = Vec3d(-p.fx, -p.fy, 1).cross(e1) / w;
    const auto form = [&](const Vec3d& s, const Vec3d& t) {
        return -(p.fxx * s.x() * t.x() + p.fxy * (s.x() * t.y() + s.y() * t.x()) + p.fyy * s.y() * t.y()) / w;
    };
    const double angle = 0.5 * std::atan2(2 * form(e1, e2), form(e1, e1) - form(e2, e2));
    const Vec3d first = std::cos(angle) * e1 + std::sin(angle) * e2;
    const Vec3d second = std::cos(angle) * e2 - std::sin(angle) * e1;
    curvature.set_from_principal(v, mean + root, mean - root, first, second);
    curvature.K[v] = gaussian;
    curvature.H[v] = mean;
}

void AnalyticPatchOptions::check() const {
    if (!(max_edge > 0 && max_edge <= 0.2))
        throw InvalidInput(fmt::format("max_edge {}: must be above 0 and at most 0.2 Å", max_edge));
    if (!(jitter >= 0 && jitter < 0.3))
        throw InvalidInput(fmt::format("jitter {}: must be from 0 to below 0.3", jitter));
    if (!(radius > 0) || margin < 1) throw InvalidInput("a patch needs a radius above 0 and a margin of 1");
    if ((radius / 0.85 + (margin + 1) * max_edge) > 0.94)
        throw InvalidInput(fmt::format("radius {} with {} rings of {} Å around it: the shapes end at 0.94 Å",
                                       radius, margin, max_edge));
}

AnalyticPatch analytic_patch(const AnalyticPatchOptions& o) {
    o.check();
    // Steepness and jitter make edges longer than the step, so that more rings are needed than flat ones.
    double step = o.max_edge;
    const auto rings = [&] {
        return static_cast<int>(std::ceil(o.radius / (step * std::sqrt(0.75)))) + o.margin;
    };
    Hexagon hexagon(rings());
    for (int turn = 0; turn < 40; ++turn) {
        const double longest = longest_edge(exact_points(hexagon, o, step), hexagon.triangles, o.radius);
        step *= o.max_edge / longest;
        if (rings() > hexagon.rings)
            hexagon = Hexagon(rings());
        else if (std::abs(longest / o.max_edge - 1) < 1e-9)
            break;
    }
    AnalyticPatch patch;
    patch.mesh.triangles = hexagon.triangles;
    patch.mesh.points.resize(hexagon.places.size());
    patch.exact.resize(hexagon.places.size(), true);
    for (std::size_t v = 0; v < hexagon.places.size(); ++v) {
        const auto [i, j] = hexagon.places[v];
        const Eigen::Vector2d at = step * lattice_place(i, j, o.jitter);
        const Vec3f p = patch.mesh.points[v] = on_surface(o, at, step);
        patch.exact.flags[v] = 0;
        set_graph_curvature(patch.exact, v, graph_point(o.shape, p.x(), p.y()));
        if (at.norm() <= o.radius) patch.measured.push_back(static_cast<VertexId>(v));
    }
    patch.longest_edge = longest_edge(patch.mesh.points, patch.mesh.triangles, o.radius);
    return patch;
}

DensityMap patch_map(PatchShape shape, double spacing, double radius) {
    if (!(spacing > 0 && spacing <= 0.1 && radius > 0 && radius <= 0.3))
        throw InvalidInput(
            fmt::format("a map of a patch of {} Å every {} Å: at most 0.3 every 0.1", radius, spacing));
    constexpr int beyond = 6;
    // Within the radius every shape stays below 0.6 r² of the plane z = 0.
    const int wide = static_cast<int>(std::ceil(radius / spacing)) + beyond;
    const int high = static_cast<int>(std::ceil(0.6 * radius * radius / spacing)) + beyond;
    const Vec3i half(wide, wide, high), size = 2 * half + Vec3i::Ones();
    Frame frame;
    frame.axes = spacing * Mat3d::Identity();
    frame.origin = -spacing * half.cast<double>();
    GridBuilder builder(size, {0, 1, 2});
    std::vector<float> samples(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
                               static_cast<std::size_t>(size.z()));
    std::size_t k = 0;
    for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
            for (int x = 0; x < size.x(); ++x)
                samples[k++] = static_cast<float>(patch_field(shape, frame.to_world(Vec3d(x, y, z))));
    builder.add_sections(samples.data(), size.z());
    return builder.finish(frame);
}

CurvatureErrors curvature_errors(const AnalyticPatch& patch, const Curvatures& estimate) {
    CurvatureErrors e;
    for (const VertexId v : patch.measured) {
        if (!estimate.defined(v) || std::isnan(estimate.K[v]) || std::isnan(estimate.H[v])) {
            const double none = std::numeric_limits<double>::infinity();
            return {none, none, none, none};
        }
        const double k = std::abs(estimate.K[v] - patch.exact.K[v]);
        const double h = std::abs(estimate.H[v] - patch.exact.H[v]);
        e.K_max = std::max(e.K_max, k);
        e.H_max = std::max(e.H_max, h);
        e.K_rms += k * k;
        e.H_rms += h * h;
    }
    const double count = static_cast<double>(patch.measured.size());
    e.K_rms = std::sqrt(e.K_rms / count);
    e.H_rms = std::sqrt(e.H_rms / count);
    return e;
}

TriMesh geodesic_sphere(double radius, int frequency) {
    if (!(radius > 0) || frequency < 1)
        throw InvalidInput("a geodesic sphere needs a radius above 0 and a frequency of 1");
    const double golden = (1 + std::sqrt(5.0)) / 2;
    const Vec3d corners[12] = {{-1, golden, 0}, {1, golden, 0}, {-1, -golden, 0}, {1, -golden, 0},
                               {0, -1, golden}, {0, 1, golden}, {0, -1, -golden}, {0, 1, -golden},
                               {golden, 0, -1}, {golden, 0, 1}, {-golden, 0, -1}, {-golden, 0, 1}};
    static constexpr int faces[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                         {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                         {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                         {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    TriMesh mesh;
    // A vertex is known by its three weights at the corners of the icosahedron, so that faces share theirs.
    using Weights = std::array<std::pair<int, int>, 3>;
    std::map<Weights, VertexId> known;
    const double arc = std::acos(1 / std::sqrt(5.0));
    const auto vertex = [&](const int* face, int a, int b, int c) {
        Weights weights{{{face[0], a}, {face[1], b}, {face[2], c}}};
        for (auto& w : weights)
            if (w.second == 0) w = {12, 0};
        std::sort(weights.begin(), weights.end());
        const auto [at, added] = known.emplace(weights, static_cast<VertexId>(mesh.points.size()));
        if (added) {
            // Sines of the parts of the edge's arc: even steps along the edges, nearly so within the faces.
            Vec3d p = Vec3d::Zero();
            for (const auto& [corner, weight] : weights)
                if (weight > 0) p += std::sin(arc * weight / frequency) * corners[corner];
            mesh.points.push_back((radius * p.normalized()).cast<float>());
        }
        return at->second;
    };
    for (const auto& face : faces)
        for (int a = 0; a < frequency; ++a)
            for (int b = 0; a + b < frequency; ++b) {
                const int c = frequency - a - b;
                mesh.triangles.push_back(
                    {vertex(face, a, b, c), vertex(face, a + 1, b, c - 1), vertex(face, a, b + 1, c - 1)});
                if (c > 1)
                    mesh.triangles.push_back({vertex(face, a + 1, b, c - 1),
                                              vertex(face, a + 1, b + 1, c - 2),
                                              vertex(face, a, b + 1, c - 1)});
            }
    return mesh;
}

}  // namespace vdbgeo
