#include "vdbgeo/measure/field_curvature.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/smoothed_view.h"

namespace vdbgeo {
namespace {

constexpr const char* stage = "curvature";
constexpr double smallest_scale = 0.5, largest_scale = 12;
/// Of a coarser axis, in its own samples: a narrower gaussian sees one sample.
constexpr double least_sigma = 0.7;
constexpr std::size_t grain = 1 << 12;
/// Most vertices of one cube that a thread takes at a time.
constexpr std::size_t longest_run = 1 << 11;

/// What the choice of a scale goes through, and what it asks for.
constexpr double scales[] = {1, 1.5, 2, 2.5, 3, 4};
/// Where the first of these already moves the surface, and how far it may: voxels, the median.
constexpr double sharp_scale = 0.7, furthest = 0.25;
/// Sees the samples as they are, near enough.
constexpr double bare_scale = 0.5;
constexpr std::size_t tried_cubes = 96, tried_vertices = 24;
constexpr double tried_step = 0.5;  // voxels along the surface
constexpr double agreement = 0.985;

/// A mask has so few values around a piece of its surface (outside the box counts as one), and this scale.
constexpr std::size_t mask_values = 3;
constexpr double mask_scale = 5;

/// A gaussian of the same width along every axis, as far as the samples allow.
struct Width {
    double sigma;  ///< Å
    Vec3d samples;

    Width(const Frame& frame, double scale) {
        const Vec3d voxel = frame.voxel_size();
        sigma = scale * voxel.minCoeff();
        samples = (sigma * voxel.cwiseInverse()).cwiseMax(std::min(least_sigma, scale));
    }
};

/// The vertices by the cubes of samples that they lie in.
class Cubes {
 public:
    Cubes(const TriMesh& mesh, const Frame& frame, const Array<std::uint8_t>& flags)
        : mesh_(mesh), frame_(frame), to_index_(frame.axes.inverse()), flags_(flags) {}

    void sort_by(int edge);
    std::size_t runs() const { return runs_.size() - 1; }
    std::size_t begin(std::size_t run) const { return runs_[run]; }
    std::size_t end(std::size_t run) const { return runs_[run + 1]; }
    VertexId vertex(std::size_t place) const { return order_[place].vertex; }
    openvdb::Coord corner(std::size_t run) const;

    const Mat3d& to_index() const { return to_index_; }
    Vec3d index(VertexId v) const { return to_index_ * (mesh_.points[v].cast<double>() - frame_.origin); }
    bool usable(VertexId v) const { return !(flags_[v] & curvature_undefined) && inside(index(v)); }

 private:
    struct Place {
        std::uint64_t cube;
        VertexId vertex;
        bool operator<(const Place& other) const {
            return cube != other.cube ? cube < other.cube : vertex < other.vertex;
        }
    };
    static constexpr int bits = 21, middle = 1 << 20;
    static constexpr std::uint64_t nowhere = ~std::uint64_t(0);

    bool inside(const Vec3d& index) const;
    std::uint64_t cube(const Vec3d& index) const;

    const TriMesh& mesh_;
    const Frame& frame_;
    Mat3d to_index_;
    const Array<std::uint8_t>& flags_;
    int edge_ = 0;
    Array<Place> order_;
    std::vector<std::size_t> runs_;
};

/// Rounding may put a vertex of the border outside the box; half a sample is what the samples stand for.
bool Cubes::inside(const Vec3d& index) const {
    constexpr double far = 1 << 22;
    if (!frame_.bounded()) return index.cwiseAbs().maxCoeff() < far;
    return (index.array() >= -0.5).all() && (index.array() <= frame_.size.cast<double>().array() - 0.5).all();
}

std::uint64_t Cubes::cube(const Vec3d& index) const {
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a)
        key = key << bits | static_cast<std::uint64_t>(std::floor(index[a] / edge_) + middle);
    return key;
}

openvdb::Coord Cubes::corner(std::size_t run) const {
    std::uint64_t key = order_[runs_[run]].cube;
    openvdb::Coord c;
    for (int a = 2; a >= 0; --a, key >>= bits)
        c[a] = (static_cast<int>(key & ((1u << bits) - 1)) - middle) * edge_;
    return c;
}

void Cubes::sort_by(int edge) {
    if (edge == edge_) return;
    edge_ = edge;
    order_.resize(mesh_.points.size());
    parallel_for(order_.size(), grain, [&](std::size_t v) {
        const auto id = static_cast<VertexId>(v);
        order_[v] = {usable(id) ? cube(index(id)) : nowhere, id};
    });
    tbb::parallel_sort(order_.begin(), order_.end());
    while (!order_.empty() && order_.back().cube == nowhere) order_.pop_back();
    runs_.clear();
    for (std::size_t i = 0; i < order_.size(); ++i)
        if (i == 0 || order_[i].cube != order_[i - 1].cube || i - runs_.back() == longest_run)
            runs_.push_back(i);
    runs_.push_back(order_.size());
}

openvdb::Coord cube_of(const Vec3d& index, int edge) {
    openvdb::Coord corner;
    for (int a = 0; a < 3; ++a) corner[a] = edge * static_cast<int>(std::floor(index[a] / edge));
    return corner;
}

struct Principal {
    double k1, k2;
    Vec3d along1, along2;
};

/// k / (1 + (kσ)⁴)^¼.
double limited(double k, double sigma) {
    const double x = k * k * sigma * sigma;
    return k / std::sqrt(std::sqrt(1 + x * x));
}

/// The shape operator ∇n on the tangent plane. False where there is no plane to speak of.
bool principal(const Derivatives& in, const Mat3d& to_index, double sigma, bool level_set, Principal& out) {
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
    out = {limited(mean + half, sigma), limited(mean - half, sigma), c * a + s * b, c * b - s * a};
    return true;
}

/// The number of cubes that a choice looks at.
std::size_t tried_runs(const Cubes& cubes) { return std::min(tried_cubes, cubes.runs()); }

/// Moves the view to one of them and calls visit(w, index) for some of its vertices, w = 0, 1, ….
template <class Visit>
void visit_tried(const Cubes& cubes, std::size_t t, SmoothedView& view, const Visit& visit) {
    const std::size_t run = t * cubes.runs() / tried_runs(cubes);
    view.move_to(cubes.corner(run));
    const std::size_t count = cubes.end(run) - cubes.begin(run), wanted = std::min(count, tried_vertices);
    for (std::size_t w = 0; w < wanted; ++w)
        visit(w, cubes.index(cubes.vertex(cubes.begin(run) + w * count / wanted)));
}

/// How much of the curvature changes over half a voxel along the surface: Σ|Δk|² over 2 Σ|k|², at some
/// vertices of some cubes.
double disagreement(const Cubes& cubes, const DensityMap& map, const Width& width, bool level_set) {
    struct Sums {
        double difference = 0, all = 0;
    };
    const double step = tried_step * map.frame.voxel_size().minCoeff();
    const Sums sums = fixed_order_reduce(
        tried_runs(cubes), 8, Sums{},
        [&](std::size_t from, std::size_t to) {
            SmoothedView view(map, width.samples);
            Sums s;
            const auto add = [&](std::size_t, const Vec3d& at) {
                Derivatives d;
                Principal here, there;
                if (!view.derivatives(at, d) || !principal(d, cubes.to_index(), width.sigma, level_set, here))
                    return;
                // Half way between the two directions, so that both values change.
                const Vec3d aside = step * M_SQRT1_2 * (here.along1 + here.along2);
                Vec3d next = at + cubes.to_index() * aside;
                if (!view.holds(next)) next = at - cubes.to_index() * aside;
                if (!view.holds(next) || !view.derivatives(next, d) ||
                    !principal(d, cubes.to_index(), width.sigma, level_set, there))
                    return;
                s.difference += std::pow(here.k1 - there.k1, 2) + std::pow(here.k2 - there.k2, 2);
                s.all += here.k1 * here.k1 + here.k2 * here.k2 + there.k1 * there.k1 + there.k2 * there.k2;
            };
            for (std::size_t t = from; t < to; ++t) visit_tried(cubes, t, view, add);
            return s;
        },
        [](Sums& to, const Sums& part) {
            to.difference += part.difference;
            to.all += part.all;
        });
    return sums.all > 0 ? sums.difference / sums.all : 0;
}

/// How far a gaussian moves the surface: the median over some vertices of the change of the density there
/// over the slope, in voxels of the finest axis. Vertices without a slope count as moved.
double displacement(const Cubes& cubes, const DensityMap& map, const Width& width) {
    const Width bare(map.frame, bare_scale);
    const int edge = SmoothedView::edge_for(bare.samples);
    const double voxel = map.frame.voxel_size().minCoeff();
    std::vector<double> moved(tried_runs(cubes) * tried_vertices, -1.0);
    parallel_blocks(tried_runs(cubes), 8, [&](std::size_t from, std::size_t to) {
        SmoothedView view(map, width.samples), sharp(map, bare.samples);
        for (std::size_t t = from; t < to; ++t)
            visit_tried(cubes, t, view, [&](std::size_t w, const Vec3d& at) {
                Derivatives seen, own;
                if (!view.derivatives(at, seen)) return;
                sharp.move_to(cube_of(at, edge));
                if (!sharp.derivatives(at, own)) return;
                const double slope = (cubes.to_index().transpose() * seen.gradient).norm() * voxel;
                const double change = std::abs(seen.value - own.value);
                moved[t * tried_vertices + w] = change < slope * 1e3 ? change / slope : 1e3;
            });
    });
    moved.erase(std::remove(moved.begin(), moved.end(), -1.0), moved.end());
    if (moved.empty()) return 0;
    const auto middle = moved.begin() + static_cast<std::ptrdiff_t>(moved.size() / 2);
    std::nth_element(moved.begin(), middle, moved.end());
    return *middle;
}

/// Whether nine of ten of the tried cubes are those of a mask.
bool is_mask(const Cubes& cubes, const DensityMap& map, const Width& width) {
    const std::size_t tried = tried_runs(cubes);
    SmoothedView view(map, width.samples);
    std::size_t found = 0;
    for (std::size_t t = 0; t < tried; ++t) {
        view.move_to(cubes.corner(t * cubes.runs() / tried));
        found += view.has_few_values(mask_values);
    }
    return tried > 0 && 10 * found >= 9 * tried;
}

double choose_scale(Cubes& cubes, const DensityMap& map, bool level_set) {
    const Width first(map.frame, scales[0]);
    cubes.sort_by(SmoothedView::edge_for(first.samples));
    if (is_mask(cubes, map, first)) return mask_scale;
    double best = sharp_scale, least = std::numeric_limits<double>::infinity();
    for (const double scale : scales) {
        const Width width(map.frame, scale);
        cubes.sort_by(SmoothedView::edge_for(width.samples));
        if (displacement(cubes, map, width) > furthest) break;
        const double found = disagreement(cubes, map, width, level_set);
        if (found <= 1 - agreement) return scale;
        if (found < least) {
            least = found;
            best = scale;
        }
    }
    return best;
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
    const Array<std::uint8_t> flags = curvature_flags(mesh, stage);
    out.resize(mesh.points.size(), true);
    out.flags = flags;
    Cubes cubes(mesh, map.frame, flags);
    out.scale = options.scale ? *options.scale : choose_scale(cubes, map, options.level_set);
    const Width width(map.frame, out.scale);
    cubes.sort_by(SmoothedView::edge_for(width.samples));
    parallel_for(out.size(), grain, [&](std::size_t v) {
        if (!cubes.usable(static_cast<VertexId>(v))) out.set_undefined(v);
    });
    progress.report(0.1);

    tbb::enumerable_thread_specific<SmoothedView> views([&] { return SmoothedView(map, width.samples); });
    std::atomic<std::size_t> done{0};
    parallel_for(cubes.runs(), 1, [&](std::size_t run) {
        SmoothedView& view = views.local();
        view.move_to(cubes.corner(run));
        Derivatives d;
        Principal p;
        for (std::size_t i = cubes.begin(run); i < cubes.end(run); ++i) {
            const VertexId v = cubes.vertex(i);
            if (view.derivatives(cubes.index(v), d) &&
                principal(d, cubes.to_index(), width.sigma, options.level_set, p))
                out.set_from_principal(v, p.k1, p.k2, p.along1, p.along2);
            else
                out.set_undefined(v);
        }
        const std::size_t now = done.fetch_add(1, std::memory_order_relaxed) + 1;
        if (now % 64 == 0)
            progress.report(0.1 + 0.9 * static_cast<double>(now) / static_cast<double>(cubes.runs()));
    });
    progress.report(1);
    return out;
}

}  // namespace vdbgeo
