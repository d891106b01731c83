#include "vdbgeo/measure/surface_distance.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/triangle_tree.h"

namespace vdbgeo {
namespace {

constexpr double most_samples = 1e10;
constexpr std::size_t block = 1024;  // faces or vertices that one thread takes at a time

/// Counts distances by the first 20 bits of their float: constant memory, whatever the number of samples, and
/// sums that do not depend on an order.
class Histogram {
 public:
    void add(double distance) {
        const float value = static_cast<float>(distance);
        std::uint32_t bits = 0;
        std::memcpy(&bits, &value, sizeof(bits));
        counts_[bits >> shift].fetch_add(1, std::memory_order_relaxed);
    }

    /// The upper end of the bin in which the quantile is.
    double quantile(double fraction, std::uint64_t samples) const {
        const double wanted = fraction * static_cast<double>(samples);
        std::uint64_t sum = 0;
        std::uint32_t bin = 0;
        for (; bin + 1 < counts_.size(); ++bin)
            if (static_cast<double>(sum += counts_[bin]) >= wanted) break;
        const std::uint32_t bits = (bin << shift) | ((1u << shift) - 1);
        float value = 0;
        std::memcpy(&value, &bits, sizeof(value));
        return value;
    }

 private:
    static constexpr int shift = 11;
    std::vector<std::atomic<std::uint64_t>> counts_ = std::vector<std::atomic<std::uint64_t>>(1u << 20);
};

struct Sums {
    double area = 0, distance = 0, squares = 0, max = 0;
    std::uint64_t samples = 0;
};

void join(Sums& sum, const Sums& part) {
    sum.area += part.area;
    sum.distance += part.distance;
    sum.squares += part.squares;
    sum.max = std::max(sum.max, part.max);
    sum.samples += part.samples;
}

struct Corners {
    Vec3d a, ab, ac;
    Corners(const TriMesh& mesh, std::size_t face)
        : a(mesh.points[mesh.triangles[face][0]].cast<double>()),
          ab(mesh.points[mesh.triangles[face][1]].cast<double>() - a),
          ac(mesh.points[mesh.triangles[face][2]].cast<double>() - a) {}
    double longest() const {
        return std::sqrt(std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()}));
    }
    double parts(double spacing) const { return std::max(1.0, std::ceil(longest() / spacing)); }
};

/// Distances of consecutive samples: what was nearest to the last one bounds the search for the next.
class Walk {
 public:
    Walk(const TriangleTree& tree, Histogram& histogram) : tree_(tree), histogram_(histogram) {}

    double squared_distance(const Vec3d& p) {
        double reach = std::numeric_limits<double>::infinity();
        if (some_) reach = (last_ - p).squaredNorm() * (1 + 1e-9) + 1e-18 * p.squaredNorm();
        TriangleTree::Nearest found = tree_.nearest(p, reach);
        if (std::isinf(found.squared_distance)) found = tree_.nearest(p);
        last_ = found.point;
        some_ = true;
        histogram_.add(std::sqrt(found.squared_distance));
        return found.squared_distance;
    }

 private:
    const TriangleTree& tree_;
    Histogram& histogram_;
    Vec3d last_ = Vec3d::Zero();
    bool some_ = false;
};

/// The samples in one face: the centres of its n² parts.
void sample_face(const Corners& face, double spacing, Walk& walk, Sums& sums) {
    const int n = static_cast<int>(face.parts(spacing));
    const double weight = face.ab.cross(face.ac).norm() / 2 / (double(n) * n);
    const auto sample = [&](double i, double j) {
        const double squared = walk.squared_distance(face.a + face.ab * (i / n) + face.ac * (j / n));
        sums.max = std::max(sums.max, squared);
        sums.squares += weight * squared;
        sums.distance += weight * std::sqrt(squared);
        sums.area += weight;
        ++sums.samples;
    };
    for (int i = 0; i < n; ++i)
        for (int j = 0; i + j < n; ++j) {
            sample(i + 1 / 3.0, j + 1 / 3.0);
            if (i + j + 1 < n) sample(i + 2 / 3.0, j + 2 / 3.0);
        }
}

/// The spacing that the options mean for this mesh.
double spacing_for(const TriMesh& mesh, const SurfaceDistanceOptions& options, const char* which) {
    struct Lengths {
        double edges = 0, area = 0;
    };
    const std::size_t faces = mesh.triangles.size();
    const Lengths sum = fixed_order_reduce(
        faces, block, Lengths{},
        [&](std::size_t begin, std::size_t end) {
            Lengths part;
            for (std::size_t f = begin; f < end; ++f) {
                const Corners c(mesh, f);
                part.edges += c.ab.norm() + c.ac.norm() + (c.ac - c.ab).norm();
                part.area += c.ab.cross(c.ac).norm() / 2;
            }
            return part;
        },
        [](Lengths& all, const Lengths& part) {
            all.edges += part.edges;
            all.area += part.area;
        });
    if (!(sum.area > 0)) throw InvalidInput(fmt::format("surface distance: the {} mesh has no area", which));
    const double spacing = options.spacing.value_or(sum.edges / (6 * static_cast<double>(faces)));
    const double samples = fixed_order_reduce(
        faces, block, 0.0,
        [&](std::size_t begin, std::size_t end) {
            double count = 0;
            for (std::size_t f = begin; f < end; ++f) {
                const double n = Corners(mesh, f).parts(spacing);
                count += n * n;
            }
            return count;
        },
        [](double& all, double part) { all += part; });
    if (!(samples < most_samples))
        throw InvalidInput(
            fmt::format("surface distance: a spacing of {} A takes {:.3g} samples, over {:.0e}", spacing,
                        samples, most_samples));
    return spacing;
}

OneSidedDistance one_sided(const TriMesh& from, const TriangleTree& to, double spacing,
                           const Progress& progress) {
    Histogram histogram;
    const std::size_t faces = from.triangles.size(), points = from.points.size();
    std::atomic<std::size_t> done{0};
    const auto advance = [&](std::size_t count) {
        progress.report(static_cast<double>(done += count) / static_cast<double>(faces + points));
    };
    Sums sums = fixed_order_reduce(
        faces, block, Sums{},
        [&](std::size_t begin, std::size_t end) {
            Walk walk(to, histogram);
            Sums part;
            for (std::size_t f = begin; f < end; ++f) sample_face(Corners(from, f), spacing, walk, part);
            advance(end - begin);
            return part;
        },
        join);
    std::vector<char> used(points, 0);
    for (const Triangle& t : from.triangles)
        for (const VertexId v : t) used[v] = 1;
    const Sums corners = fixed_order_reduce(
        points, block, Sums{},
        [&](std::size_t begin, std::size_t end) {
            Walk walk(to, histogram);
            Sums part;
            for (std::size_t v = begin; v < end; ++v) {
                if (!used[v]) continue;
                part.max = std::max(part.max, walk.squared_distance(from.points[v].cast<double>()));
                ++part.samples;
            }
            advance(end - begin);
            return part;
        },
        join);
    join(sums, corners);
    OneSidedDistance result;
    result.max = std::sqrt(sums.max);
    result.mean = sums.distance / sums.area;
    result.rms = std::sqrt(sums.squares / sums.area);
    result.p999 = std::min(result.max, histogram.quantile(0.999, sums.samples));
    result.samples = sums.samples;
    return result;
}

}  // namespace

void SurfaceDistanceOptions::check() const {
    if (spacing && !(std::isfinite(*spacing) && *spacing > 0))
        throw InvalidInput(
            fmt::format("surface distance: spacing {} A where a number above 0 is needed", *spacing));
}

SurfaceDistance surface_distance(const TriMesh& a, const TriMesh& b, const SurfaceDistanceOptions& options,
                                 const Progress& progress) {
    options.check();
    if (a.empty()) throw InvalidInput("surface distance: the first mesh has no faces");
    if (b.empty()) throw InvalidInput("surface distance: the second mesh has no faces");
    check(a, "surface distance: first mesh");
    check(b, "surface distance: second mesh");
    const double spacing_a = spacing_for(a, options, "first"), spacing_b = spacing_for(b, options, "second");
    SurfaceDistance result;
    result.forward = one_sided(a, TriangleTree(b), spacing_a, progress.part(0, 0.5));
    result.backward = one_sided(b, TriangleTree(a), spacing_b, progress.part(0.5, 1));
    result.hausdorff = std::max(result.forward.max, result.backward.max);
    return result;
}

}  // namespace vdbgeo
