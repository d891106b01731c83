#include "vdbgeo/measure/field_curvature.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/smoothed_window.h"

namespace vdbgeo {
namespace {

constexpr const char* stage = "curvature";
constexpr double smallest_scale = 0.5, largest_scale = 12;
/// Of a coarser axis, in its own samples: a narrower gaussian sees one sample.
constexpr double least_sigma = 0.7;
constexpr std::size_t grain = 1 << 12;
/// Most vertices of one cube that a thread takes at a time.
constexpr std::size_t longest_run = 1 << 11;

struct Place {
    std::uint64_t cube;
    VertexId vertex;
    bool operator<(const Place& other) const {
        return cube != other.cube ? cube < other.cube : vertex < other.vertex;
    }
};

/// Index coordinates of the vertices, and which cube each is in.
class Places {
 public:
    Places(const TriMesh& mesh, const Frame& frame, int edge) : mesh_(mesh), frame_(frame), edge_(edge) {
        to_index_ = frame.axes.inverse();
    }

    Vec3d index(VertexId v) const { return to_index_ * (mesh_.points[v].cast<double>() - frame_.origin); }
    /// None where the map does not reach: more than half a sample outside its box.
    bool inside(const Vec3d& index) const {
        constexpr double far = 1 << 24;
        if (!frame_.bounded()) return index.cwiseAbs().maxCoeff() < far;
        return (index.array() >= -0.5).all() &&
               (index.array() <= frame_.size.cast<double>().array() - 0.5).all();
    }
    std::uint64_t cube(const Vec3d& index) const {
        std::uint64_t key = 0;
        for (int a = 0; a < 3; ++a) key = key << 21 | static_cast<std::uint64_t>(part(index[a]) + (1 << 20));
        return key;
    }
    openvdb::Coord corner(std::uint64_t cube) const {
        openvdb::Coord c;
        for (int a = 2; a >= 0; --a, cube >>= 21)
            c[a] = (static_cast<int>(cube & 0x1fffff) - (1 << 20)) * edge_;
        return c;
    }

 private:
    int part(double x) const { return static_cast<int>(std::floor(std::floor(x) / edge_)); }

    const TriMesh& mesh_;
    const Frame& frame_;
    int edge_;
    Mat3d to_index_;
};

/// Goldman 2005: the shape operator ∇n on the tangent plane.
bool set_from_field(Curvatures& out, std::size_t v, const Derivatives& in, const Mat3d& to_index,
                    double sigma, bool level_set) {
    const Vec3d g = to_index.transpose() * in.gradient;
    const Mat3d hessian = to_index.transpose() * in.hessian * to_index;
    const double slope = g.norm();
    constexpr double float_rounding = 0x1p-23, flattest = 1e-6;
    if (!(slope * sigma > float_rounding * std::abs(in.value)) ||
        !(slope > flattest * sigma * hessian.norm()))
        return false;
    const Vec3d n = g / slope;
    const Vec3d a = n.unitOrthogonal(), b = n.cross(a);
    const double sign = (level_set ? 1 : -1) / slope;
    const double aa = sign * a.dot(hessian * a), ab = sign * a.dot(hessian * b),
                 bb = sign * b.dot(hessian * b);
    const double mean = 0.5 * (aa + bb), half = std::hypot(0.5 * (aa - bb), ab);
    const double angle = 0.5 * std::atan2(2 * ab, aa - bb), c = std::cos(angle), s = std::sin(angle);
    out.set_from_principal(v, mean + half, mean - half, c * a + s * b, c * b - s * a);
    return true;
}

}  // namespace

void FieldCurvatureOptions::check() const {
    if (scale && !(*scale >= smallest_scale && *scale <= largest_scale))
        throw InvalidInput(fmt::format("field curvature: scale is {} voxels, expected {} to {}", *scale,
                                       smallest_scale, largest_scale));
}

FieldCurvature field_curvature(const TriMesh& mesh, const DensityMap& map,
                               const FieldCurvatureOptions& options, const Progress& progress) {
    options.check();
    FieldCurvature out;
    Array<std::uint8_t> flags = curvature_flags(mesh, stage);
    out.resize(mesh.points.size(), true);
    out.flags = std::move(flags);
    out.scale = options.scale.value_or(1.5);

    const Vec3d voxel = map.frame.voxel_size();
    const double sigma = out.scale * voxel.minCoeff();
    const Vec3d sigmas = (sigma * voxel.cwiseInverse()).cwiseMax(std::min(least_sigma, out.scale));
    const Places places(mesh, map.frame, SmoothedView::edge_for(sigmas));
    const Mat3d to_index = map.frame.axes.inverse();

    std::vector<Place> order;
    order.reserve(out.size());
    for (std::size_t v = 0; v < out.size(); ++v) {
        const auto id = static_cast<VertexId>(v);
        const Vec3d index = places.index(id);
        if (!out.defined(v) || !places.inside(index))
            out.set_undefined(v);
        else
            order.push_back({places.cube(index), id});
    }
    tbb::parallel_sort(order.begin(), order.end());
    std::vector<std::size_t> runs;
    for (std::size_t i = 0; i < order.size(); ++i)
        if (i == 0 || order[i].cube != order[i - 1].cube || i - runs.back() == longest_run) runs.push_back(i);
    runs.push_back(order.size());

    tbb::enumerable_thread_specific<SmoothedView> views([&] { return SmoothedView(map, sigmas); });
    std::atomic<std::size_t> done{0};
    parallel_for(runs.size() - 1, 1, [&](std::size_t r) {
        SmoothedView& view = views.local();
        view.move_to(places.corner(order[runs[r]].cube));
        Derivatives d;
        for (std::size_t i = runs[r]; i < runs[r + 1]; ++i) {
            const VertexId v = order[i].vertex;
            if (!view.derivatives(places.index(v), d) ||
                !set_from_field(out, v, d, to_index, sigma, options.level_set))
                out.set_undefined(v);
        }
        const std::size_t now = done.fetch_add(1, std::memory_order_relaxed) + 1;
        if (now % 64 == 0) progress.report(static_cast<double>(now) / static_cast<double>(runs.size()));
    });
    progress.report(1);
    return out;
}

}  // namespace vdbgeo
