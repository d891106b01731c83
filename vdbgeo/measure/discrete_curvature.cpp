#include "vdbgeo/measure/discrete_curvature.h"

#include <cmath>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/one_ring.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 13;
constexpr double pi = 3.14159265358979323846;
constexpr const char* stage = "curvature";

/// A sum of angles between 0 and π, as the phase of a product of complex numbers: one arc tangent for all.
class AngleSum {
 public:
    /// The phase of x + i y, y > 0.
    void add(double x, double y) {
        const bool upper = y_ >= 0;
        const double real = x_ * x - y_ * y, imaginary = x_ * y + y_ * x;
        // Less than half a turn further, the lower half plane is reached only through the negative axis.
        half_turns_ += upper & (imaginary < 0) ? 2 : 0;
        x_ = real;
        y_ = imaginary;
        // The largest and smallest factors that floats can make are 1e77 and 1e-90.
        if (const double size = std::abs(x_) + std::abs(y_); size > 1e100 || size < 1e-100) {
            x_ /= size;
            y_ /= size;
        }
    }
    void add_half_turn() { ++half_turns_; }

    double value() const { return std::atan2(y_ + 0.0, x_) + half_turns_ * pi; }

 private:
    double x_ = 1, y_ = 0;
    int half_turns_ = 0;
};

/// What the faces around a vertex add up to.
struct RingSums {
    AngleSum angles;
    Vec3d area_gradient = Vec3d::Zero();  ///< Σ (cot α + cot β) (v − w)
    Vec3d normal = Vec3d::Zero();         ///< area-weighted, twice
    double area = 0;                      ///< dual, times 8
    bool has_area = false;
};

/// A face without area at its corner: the angle that faces with an area tend to.
void add_flat_face(RingSums& sums, double squared_out, double squared_in, double dot) {
    if (squared_out == 0 && squared_in == 0)
        sums.angles.add(0.5, 0.86602540378443864676);
    else if (squared_out == 0 || squared_in == 0)
        sums.angles.add(0, 1);
    else if (dot < 0)
        sums.angles.add_half_turn();
}

/// Eight times the part of a face's area that belongs to a corner with the edges a and b: their squared
/// lengths and product.
template <DualArea kind>
double corner_area(double aa, double bb, double ab, double twice_area, double inverse) {
    if constexpr (kind == DualArea::barycentric) return twice_area * (4.0 / 3);
    if constexpr (kind == DualArea::mixed) {
        if (ab < 0) return 2 * twice_area;
        if (aa < ab || bb < ab) return twice_area;
    }
    return (aa * (bb - ab) + bb * (aa - ab)) * inverse;
}

template <DualArea kind>
RingSums sum_ring(const TriMesh& mesh, const OneRing& ring) {
    RingSums sums;
    const Vec3d p = mesh.points[ring.vertex()].cast<double>();
    for (std::size_t k = 0; k < ring.size(); ++k) {
        const Vec3d a = mesh.points[ring.out(k)].cast<double>() - p;
        const Vec3d b = mesh.points[ring.in(k)].cast<double>() - p;
        const Vec3d normal = a.cross(b);
        const double twice_area = normal.norm(), aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b);
        if (!(twice_area > 0)) {
            add_flat_face(sums, aa, bb, ab);
            continue;
        }
        const double inverse = 1 / twice_area;
        sums.has_area = true;
        sums.angles.add(ab, twice_area);
        sums.normal += normal;
        // A corner's pull on the area is the edge opposite, turned by a right angle.
        sums.area_gradient += normal.cross(b - a) * inverse;
        sums.area += corner_area<kind>(aa, bb, ab, twice_area, inverse);
    }
    return sums;
}

/// H from H n = ∇A / (2 A), which is Eq 15.
double mean_curvature(const RingSums& sums, double area, bool border) {
    const double along = sums.area_gradient.dot(sums.normal);
    if (border) {
        const double norm = sums.normal.norm();
        return norm > 0 ? along / norm / (4 * area) : 0;
    }
    return std::copysign(sums.area_gradient.norm(), along) / (4 * area);
}

template <DualArea kind>
void fill_vertex(const TriMesh& mesh, OneRing& ring, std::uint64_t& misoriented, DiscreteCurvature& out) {
    const VertexId v = ring.vertex();
    const RingSums sums = sum_ring<kind>(mesh, ring);
    out.flags[v] = ring.flags(sums.has_area, misoriented);
    const double area = out.dual_area[v] = sums.area / 8;
    if (!out.defined(v) || area == 0) return out.set_undefined(v);
    const bool border = out.flags[v] & curvature_border;
    out.set_from_invariants(v, ((border ? pi : 2 * pi) - sums.angles.value()) / area,
                            mean_curvature(sums, area, border));
}

template <DualArea kind>
void fill_all(const TriMesh& mesh, const VertexFaces& faces, const Progress& progress,
              DiscreteCurvature& out) {
    std::atomic<std::uint64_t> misoriented{0}, done{0};
    const std::size_t count = mesh.points.size();
    parallel_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
        OneRing ring(mesh, faces);
        std::uint64_t turned = 0;
        for (std::size_t v = begin; v < end; ++v) {
            ring.fill(static_cast<VertexId>(v));
            fill_vertex<kind>(mesh, ring, turned, out);
        }
        misoriented.fetch_add(turned, std::memory_order_relaxed);
        progress.report(static_cast<double>(done += end - begin) / static_cast<double>(count));
    });
    check_oriented(misoriented, stage);
}

}  // namespace

DiscreteCurvature discrete_curvature(const TriMesh& mesh, const DiscreteCurvatureOptions& options,
                                     const Progress& progress) {
    check_curvature_input(mesh, stage);
    const VertexFaces faces(mesh);
    progress.report(0.2);
    DiscreteCurvature out;
    out.resize(mesh.points.size(), false);
    out.dual_area.resize(mesh.points.size());
    const Progress rest = progress.part(0.2, 1);
    switch (options.area) {
        case DualArea::barycentric:
            fill_all<DualArea::barycentric>(mesh, faces, rest, out);
            break;
        case DualArea::voronoi:
            fill_all<DualArea::voronoi>(mesh, faces, rest, out);
            break;
        case DualArea::mixed:
            fill_all<DualArea::mixed>(mesh, faces, rest, out);
            break;
    }
    return out;
}

}  // namespace vdbgeo
