#include "vdbgeo/measure/wide_fits.h"

#include <tbb/enumerable_thread_specific.h>

#include <atomic>
#include <cstdint>
#include <limits>
#include <vector>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr double wide = 9.6;                   // spacings
constexpr double cover = 0.125, blend = 0.25;  // of the radius
constexpr std::size_t block = 256;
constexpr std::uint32_t no_anchor = std::numeric_limits<std::uint32_t>::max();

struct Anchor {
    VertexId vertex;
    bool found = false;
    Mat3d shape;  // the shape operator as a matrix of space
    Vec3d normal;
};

std::vector<Anchor> find_anchors(const ScaledFits& fits, const FitScale& scale, const Curvatures& out) {
    const FitSurface& surface = fits.surface();
    VertexPatch patch(surface.mesh(), surface.neighbours());
    std::vector<char> covered(out.size(), 0);
    std::vector<Anchor> anchors;
    for (std::size_t i = 0; i < out.size(); ++i) {
        if (covered[i] || !out.defined(i)) continue;
        const auto v = static_cast<VertexId>(i);
        anchors.emplace_back().vertex = v;
        for (const auto& m : patch.ball(v, cover * fits.radius(v, scale))) covered[m.vertex] = 1;
    }
    return anchors;
}

/// A direction of the plane across a turned into the plane across b, the short way.
Vec3d turned(const Vec3d& d, const Vec3d& a, const Vec3d& b) {
    return d - b.dot(d) / (1 + a.dot(b)) * (a + b);
}

class Blender {
 public:
    Blender(const ScaledFits& fits, const std::vector<Anchor>& anchors, const Array<std::uint32_t>& at)
        : fits_(fits),
          anchors_(anchors),
          at_(at),
          patch_(fits.surface().mesh(), fits.surface().neighbours()) {}

    /// False where no anchor is near that faces the same way.
    bool blend_at(VertexId v, const FitScale& scale, FittedCurvature& out) {
        const double radius = blend * fits_.radius(v, scale);
        const Vec3d here = fits_.surface().point(v), facing = fits_.surface().normal(v).cast<double>();
        near_.clear();
        Vec3d normal = Vec3d::Zero();
        for (const auto& m : patch_.ball(v, radius)) {
            if (at_[m.vertex] == no_anchor) continue;
            const Anchor& a = anchors_[at_[m.vertex]];
            const double q = static_cast<double>(m.distance) / radius;
            const double weight = (1 - q * q) * (1 - q * q) * a.normal.dot(facing);
            if (!a.found || !(weight > 0)) continue;
            near_.push_back({&a, weight});
            // The anchor's normal, carried to v by the turning of normals along the surface.
            normal += weight * (a.normal + a.shape * (here - fits_.surface().point(m.vertex)));
        }
        if (!(normal.squaredNorm() > 0)) return false;
        const TangentFrame frame(normal.normalized());
        Eigen::Matrix2d shape = Eigen::Matrix2d::Zero();
        double weights = 0;
        for (const Near& n : near_) {
            const Vec3d x = turned(frame.x, frame.z, n.anchor->normal),
                        y = turned(frame.y, frame.z, n.anchor->normal);
            const Vec3d sx = n.anchor->shape * x, sy = n.anchor->shape * y;
            shape(0, 0) += n.weight * x.dot(sx);
            shape(0, 1) += n.weight * x.dot(sy);
            shape(1, 1) += n.weight * y.dot(sy);
            weights += n.weight;
        }
        shape /= weights;
        const GraphCurvature k(0, 0, -shape(0, 0), -shape(0, 1), -shape(1, 1));
        out.k1 = k.first;
        out.k2 = k.second;
        out.direction1 = frame.world(k.first_direction);
        out.direction2 = frame.world(k.second_direction);
        return true;
    }

 private:
    struct Near {
        const Anchor* anchor;
        double weight;
    };

    const ScaledFits& fits_;
    const std::vector<Anchor>& anchors_;
    const Array<std::uint32_t>& at_;
    VertexPatch patch_;
    std::vector<Near> near_;
};

}  // namespace

bool is_wide(const ScaledFits& fits, const FitScale& scale) {
    return scale.rings == 0 && fits.relative_width(scale) >= wide;
}

void fit_by_anchors(const ScaledFits& fits, const FitScale& scale, Curvatures& out,
                    const Progress& progress) {
    std::vector<Anchor> anchors = find_anchors(fits, scale, out);
    progress.report(0.1);
    Array<std::uint32_t> at;
    at.assign(out.size(), no_anchor);
    tbb::enumerable_thread_specific<PatchFit> patches([&] { return PatchFit(fits.surface()); });
    std::atomic<std::size_t> done{0};
    parallel_blocks(anchors.size(), block, [&](std::size_t begin, std::size_t end) {
        PatchFit& patch = patches.local();
        FittedCurvature k;
        for (std::size_t i = begin; i < end; ++i) {
            Anchor& a = anchors[i];
            at[a.vertex] = static_cast<std::uint32_t>(i);
            a.found = fits.fit_anyhow(patch, a.vertex, scale, k);
            if (!a.found) continue;
            a.shape = k.k1 * k.direction1 * k.direction1.transpose() +
                      k.k2 * k.direction2 * k.direction2.transpose();
            a.normal = k.normal;
        }
        const std::size_t count = done += end - begin;
        progress.report(0.1 + 0.6 * static_cast<double>(count) / static_cast<double>(anchors.size()));
    });
    tbb::enumerable_thread_specific<Blender> blenders([&] { return Blender(fits, anchors, at); });
    done = 0;
    parallel_blocks(out.size(), 4 * block, [&](std::size_t begin, std::size_t end) {
        Blender& blender = blenders.local();
        PatchFit& patch = patches.local();
        FittedCurvature k;
        for (std::size_t i = begin; i < end; ++i) {
            const auto v = static_cast<VertexId>(i);
            if (out.defined(i) && (blender.blend_at(v, scale, k) || fits.fit_anyhow(patch, v, scale, k)))
                out.set_from_principal(i, k.k1, k.k2, k.direction1, k.direction2);
            else
                out.set_undefined(i);
        }
        const std::size_t count = done += end - begin;
        progress.report(0.7 + 0.3 * static_cast<double>(count) / static_cast<double>(out.size()));
    });
}

}  // namespace vdbgeo
