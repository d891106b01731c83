#include "vdbgeo/tet/size_field.h"

#include <fmt/format.h>
#include <openvdb/tree/ValueAccessor.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <queue>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/vertex_neighbours.h"
#include "vdbgeo/measure/triangle_tree.h"

namespace vdbgeo {
namespace {

void check_bounds(double min, double max) {
    if (!(min > 0 && min <= max && std::isfinite(max)))
        throw InvalidInput(fmt::format(
            "size field: the least size is {} Å and the largest {} Å, where 0 < least <= largest is needed",
            min, max));
}

std::vector<double> sizes_by_curvature(const TriMesh& surface, const CurvatureSizeOptions& o) {
    const MeshProperty* properties[] = {surface.find_vertex_property("k1"),
                                        surface.find_vertex_property("k2")};
    std::vector<double> sizes(surface.points.size(), o.max_A);
    for (const MeshProperty* property : properties) {
        if (!property || property->components != 1)
            throw InvalidInput(
                "size field: the mesh has no principal curvatures (vertex properties k1 and k2); run "
                "curvature "
                "first");
        for (std::size_t v = 0; v < sizes.size(); ++v) {
            const double size = 2 * M_PI / (o.edges_per_turn * std::abs(double(property->values[v])));
            if (size < sizes[v]) sizes[v] = std::max(size, o.min_A);
        }
    }
    return sizes;
}

/// The largest sizes below the given ones that grow by no more than `gradation` along each edge: shortest
/// paths from all vertices at once (Dijkstra).
void limit_growth(const TriMesh& surface, double gradation, std::vector<double>& sizes) {
    const VertexNeighbours around(surface);
    using Entry = std::pair<double, VertexId>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (VertexId v = 0; v < sizes.size(); ++v) queue.emplace(sizes[v], v);
    while (!queue.empty()) {
        const auto [size, v] = queue.top();
        queue.pop();
        if (size > sizes[v]) continue;
        for (std::uint64_t i = around.begin[v]; i < around.begin[v + 1]; ++i) {
            const VertexId n = around.neighbours[i];
            const double length = double((surface.points[n] - surface.points[v]).norm());
            const double most = size + gradation * length;
            if (!(most < sizes[n])) continue;
            sizes[n] = most;
            queue.emplace(most, n);
        }
    }
}

/// Weights of the corners of a face at a point of it.
Vec3d barycentric(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
    const Vec3d n = (b - a).cross(c - a);
    const double area = n.squaredNorm();
    if (!(area > 0)) return Vec3d::Constant(1.0 / 3);
    Vec3d w((c - b).cross(p - b).dot(n), (a - c).cross(p - c).dot(n), (b - a).cross(p - a).dot(n));
    w = (w / area).cwiseMax(0);
    return w / w.sum();
}

/// What a curvature_size field asks.
struct SurfaceSizes {
    TriMesh surface;
    std::vector<double> sizes;
    TriangleTree tree;
    CurvatureSizeOptions options;

    double operator()(const Vec3d& p) const {
        const TriangleTree::Nearest near = tree.nearest(p);
        const Triangle& t = surface.triangles[near.face];
        const auto corner = [&](std::size_t k) { return surface.points[t[k]].cast<double>().eval(); };
        const Vec3d weights = barycentric(corner(0), corner(1), corner(2), near.point);
        const double size = weights.dot(Vec3d(sizes[t[0]], sizes[t[1]], sizes[t[2]])) +
                            options.gradation * std::sqrt(near.squared_distance);
        return std::clamp(size, options.min_A, options.max_A);
    }
};

struct DensitySizes {
    openvdb::FloatGrid::ConstPtr grid;
    Frame frame;
    Mat3d to_index;
    DensitySizeOptions options;

    double density(const Vec3d& world) const {
        Vec3d index = to_index * (world - frame.origin);
        if (frame.bounded()) index = index.cwiseMax(0).cwiseMin((frame.size - Vec3i::Ones()).cast<double>());
        index = index.cwiseMax(-1e9).cwiseMin(1e9);
        const Vec3d low = index.array().floor();
        const Vec3d t = index - low;
        // Registers nothing with the tree: any thread may make one, and the process of a forked child.
        const openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> values(grid->tree());
        const openvdb::Coord base(int(low.x()), int(low.y()), int(low.z()));
        double sum = 0;
        for (int k = 0; k < 8; ++k) {
            const int x = k & 1, y = k >> 1 & 1, z = k >> 2;
            const double weight = (x ? t.x() : 1 - t.x()) * (y ? t.y() : 1 - t.y()) * (z ? t.z() : 1 - t.z());
            if (weight > 0) sum += weight * double(values.getValue(base.offsetBy(x, y, z)));
        }
        return sum;
    }

    double operator()(const Vec3d& p) const {
        const double d = density(p);
        if (!(d > options.low)) return options.max_A;
        const double part = std::min(1.0, (d - options.low) / (options.high - options.low));
        return options.max_A + part * (options.min_A - options.max_A);
    }
};

}  // namespace

void CurvatureSizeOptions::check() const {
    check_bounds(min_A, max_A);
    if (!(edges_per_turn > 0 && std::isfinite(edges_per_turn)))
        throw InvalidInput(
            fmt::format("size field: {} edges per turn, where more than 0 is needed", edges_per_turn));
    if (!(gradation >= 0 && std::isfinite(gradation)))
        throw InvalidInput(
            fmt::format("size field: the gradation is {}, where 0 or more is needed", gradation));
}

void DensitySizeOptions::check() const {
    check_bounds(min_A, max_A);
    if (!(low < high && std::isfinite(low) && std::isfinite(high)))
        throw InvalidInput(
            fmt::format("size field: densities from {} to {}, where low < high is needed", low, high));
}

SizeField curvature_size(const TriMesh& surface, const CurvatureSizeOptions& options) {
    options.check();
    check(surface, "size field");
    if (surface.empty()) throw InvalidInput("size field: the surface has no faces");
    std::vector<double> sizes = sizes_by_curvature(surface, options);
    limit_growth(surface, options.gradation, sizes);
    TriMesh bare{surface.points, surface.triangles, {}, {}};
    TriangleTree tree(bare);
    const auto field = std::make_shared<const SurfaceSizes>(
        SurfaceSizes{std::move(bare), std::move(sizes), std::move(tree), options});
    return [field](const Vec3d& p) { return (*field)(p); };
}

SizeField density_size(const DensityMap& map, const DensitySizeOptions& options) {
    options.check();
    const DensitySizes field{map.grid, map.frame, map.frame.axes.inverse(), options};
    return [field](const Vec3d& p) { return field(p); };
}

}  // namespace vdbgeo
