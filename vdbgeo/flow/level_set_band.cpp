#include "vdbgeo/flow/level_set_band.h"

#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>
#include <openvdb/tree/NodeManager.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using openvdb::FloatGrid;
using openvdb::FloatTree;
using stencil::BlockField;
using stencil::BlockLayout;
using stencil::Tile;

constexpr double pi = 3.14159265358979323846;

struct Nearest {
    bool found = false;
    double distance = 0;
    Vec3d normal = Vec3d::Zero();  // of the zero level there, along ∇φ
};

/// Finds the point of the zero level that is nearest to a voxel.
class NearestPoint {
 public:
    NearestPoint(const DenseWindow& phi, int half_width) : phi_(phi), half_width_(half_width) {}

    Nearest find(int x, int y, int z) const {
        const Vec3d from(x, y, z);
        Vec3d start;
        if (begin(x, y, z, start)) {
            const Nearest result = follow(from, start);
            if (result.found) return result;
        }
        return nearest_crossing(x, y, z);
    }

 private:
    float value(const int p[3]) const { return *phi_.at(p[0], p[1], p[2]); }

    bool gradient(const int p[3], Vec3d& g) const {
        const float* at = phi_.at(p[0], p[1], p[2]);
        g = Vec3d(at[phi_.stride_x] - at[-phi_.stride_x], at[phi_.stride_y] - at[-phi_.stride_y],
                  at[1] - at[-1]) /
            2;
        return g.squaredNorm() > 0.04;  // false for NaN
    }

    /// A point near the zero level: along the gradient, from the voxel itself or, where that is new in the
    /// band, from the voxel further inside that one comes to by going down |φ|.
    bool begin(int x, int y, int z, Vec3d& start) const {
        int p[3] = {x, y, z};
        for (int moves = 0; std::abs(value(p)) > half_width_ - 2 && moves < 4; ++moves) {
            int best[3] = {p[0], p[1], p[2]};
            for (int i = 0; i < 27; ++i) {
                const int q[3] = {p[0] + i / 9 - 1, p[1] + i / 3 % 3 - 1, p[2] + i % 3 - 1};
                if (std::abs(value(q)) < std::abs(value(best))) std::copy_n(q, 3, best);
            }
            std::copy_n(best, 3, p);
        }
        Vec3d g;
        if (!gradient(p, g)) return false;
        Vec3d step = -value(p) * g / g.squaredNorm();
        step *= std::min(1.0, (half_width_ + 1) / std::max(step.norm(), 1e-30));
        start = Vec3d(p[0], p[1], p[2]) + step;
        return true;
    }

    /// Newton's method: onto the zero level along the gradient, and across it to below the voxel.
    Nearest follow(const Vec3d& from, Vec3d at) const {
        constexpr int most = 16;
        constexpr double on_level = 3e-4, below = 1e-3, nearly_below = 0.2;
        Nearest out;
        for (int i = 0; i <= most; ++i) {
            const ValueAndGradient v = smooth_value(phi_, at);
            const double g2 = v.gradient.squaredNorm();
            if (!(g2 > 0.04) || !std::isfinite(v.value)) return {};
            const Vec3d gap = from - at;
            const Vec3d across = gap - gap.dot(v.gradient) / g2 * v.gradient;
            const bool on = std::abs(v.value) < on_level * std::sqrt(g2);
            // What is left along the gradient is added; what is left across counts squared, times the
            // curvature.
            if (on && across.norm() < (i < most ? below : nearly_below)) {
                out.found = true;
                out.distance = std::abs(gap.dot(v.gradient) + v.value) / std::sqrt(g2);
                out.normal = v.gradient / std::sqrt(g2);
                return out;
            }
            Vec3d step = across - v.value / g2 * v.gradient;
            if (step.norm() > 1) step /= step.norm();
            at += step;
        }
        return out;
    }

    /// The nearest place where φ, taken as linear, changes sign along an edge between neighbouring voxels.
    /// Goes outward shell by shell, and ends where no further shell can hold a nearer one.
    Nearest nearest_crossing(int x, int y, int z) const {
        const int r = half_width_ + 2;
        Nearest out;
        double best = r * r;
        for (int shell = 0; shell <= r && (shell < 2 || (shell - 1) * (shell - 1) < best); ++shell)
            for (int i = -shell; i <= shell; ++i)
                for (int j = -shell; j <= shell; ++j) {
                    const bool side = std::abs(i) == shell || std::abs(j) == shell;
                    for (int k = -shell; k <= shell; k += side || shell == 0 ? 1 : 2 * shell)
                        take_crossings({x, y, z}, {x + i, y + j, z + k}, best, out);
                }
        if (*phi_.at(x, y, z) < 0) out.normal = -out.normal;
        return out;
    }
    /// The crossings of the three edges from voxel q on, where they are nearer to `from` than √best.
    void take_crossings(const Vec3i& from, const Vec3i& q, double& best, Nearest& out) const {
        const std::ptrdiff_t strides[3] = {phi_.stride_x, phi_.stride_y, 1};
        const float* at = phi_.at(q[0], q[1], q[2]);
        for (int a = 0; a < 3; ++a) {
            const float b = at[strides[a]];
            if (std::isnan(*at) || std::isnan(b) || (*at < 0) == (b < 0)) continue;
            Vec3d p = q.cast<double>();
            p[a] += static_cast<double>(*at) / (static_cast<double>(*at) - b);
            const Vec3d gap = from.cast<double>() - p;
            const double d2 = gap.squaredNorm();
            if (d2 >= best) continue;
            best = d2;
            out.found = true;
            out.distance = std::sqrt(d2);
            out.normal = gap / std::max(out.distance, 1e-6);
        }
    }

    const DenseWindow& phi_;
    int half_width_;
};

/// Smeared step of φ, 1 inside, over ±width; and its slope.
double inside(double phi, double width) {
    if (phi <= -width) return 1;
    if (phi >= width) return 0;
    const double t = phi / width;
    return 0.5 * (1 - t - std::sin(pi * t) / pi);
}

double delta(double phi, double width) {
    return std::abs(phi) >= width ? 0 : 0.5 * (1 + std::cos(pi * phi / width)) / width;
}

}  // namespace

DenseWindow window_of(const Tile& t, std::size_t field, std::size_t scratch) {
    const int h = t.halo;
    const float* in = t.in[field];
    float* out = t.scratch[scratch];
    for (int x = -h; x < BlockLayout::size_x + h; ++x)
        for (int y = -h; y < BlockLayout::size_y + h; ++y) {
            const std::ptrdiff_t row = t.at(x, y, 0);
            for (int z = -h; z < BlockLayout::size_z + h; ++z)
                out[row + z] = t.active[row + z] != 0 ? in[row + z] : not_a_value;
        }
    return {out,
            t.stride_x,
            t.stride_y,
            {-h, -h, -h},
            {BlockLayout::size_x + h - 1, BlockLayout::size_y + h - 1, BlockLayout::size_z + h - 1}};
}

SurfaceBand::SurfaceBand(const FloatGrid& level_set, int half_width, const Progress& progress)
    : progress_(progress), half_width_(half_width), tree_(std::make_shared<FloatTree>(level_set.tree())) {
    const auto scale = static_cast<float>(1 / level_set.voxelSize()[0]);
    tree_->voxelizeActiveTiles();
    openvdb::tree::NodeManager<FloatTree> nodes(*tree_);
    nodes.foreachTopDown([scale](auto& node, std::size_t = 0) {
        for (auto it = node.beginValueOn(); it; ++it) it.setValue(*it * scale);
    });
    openvdb::tools::changeLevelSetBackground(*tree_, static_cast<float>(half_width));
    for (std::uint64_t before = 0; tree_->activeVoxelCount() != before;) {  // one layer of voxels a round
        before = tree_->activeVoxelCount();
        rebuild();
        if (vanished_) return;
    }
}

void SurfaceBand::trim() {
    const auto width = static_cast<float>(half_width_);
    openvdb::tree::LeafManager<FloatTree> leaves(*tree_);
    parallel_for(leaves.leafCount(), 16, [&](std::size_t i) {
        for (auto it = leaves.leaf(i).beginValueOn(); it; ++it)
            if (!(std::abs(*it) < width)) {
                it.setValue(*it < 0 ? -width : width);
                it.setValueOff();
            }
    });
    openvdb::tools::pruneLevelSet(*tree_);
}

void SurfaceBand::rebuild() {
    if (!phi_.empty()) stencil::store(layout_, phi_.brick(0), 0, *tree_);
    trim();
    openvdb::tools::dilateActiveValues(*tree_, 1, openvdb::tools::NN_FACE_EDGE_VERTEX);
    tree_->voxelizeActiveTiles();
    layout_ = BlockLayout(*tree_);
    phi_ = BlockField(layout_.brick_count());
    for (BlockField& n : normal_) n = BlockField(layout_.brick_count());
    redistance();
    count_inside();
}

void SurfaceBand::redistance() {
    BlockField moved(layout_.brick_count());
    stencil::load(layout_, *tree_, 0, moved.brick(0));
    std::atomic<bool> any{false};
    stencil::TileFields fields;
    fields.in = {moved.brick(0)};
    fields.out = {phi_.brick(0), normal_[0].brick(0), normal_[1].brick(0), normal_[2].brick(0)};
    fields.halo = halo();
    fields.scratch = 1;
    stencil::for_each_tile(
        layout_, fields,
        [&](Tile& t) {
            const DenseWindow phi = window_of(t, 0, 0);
            const NearestPoint search(phi, half_width_);
            for_active(t, [&](int x, int y, int z, std::ptrdiff_t at) {
                const Nearest nearest = search.find(x, y, z);
                const double d = nearest.found ? nearest.distance : half_width_ + 2;
                t.out[0][at] = static_cast<float>(phi.data[at] < 0 ? -d : d);
                for (std::size_t a = 0; a < 3; ++a)
                    t.out[a + 1][at] = static_cast<float>(nearest.normal[static_cast<int>(a)]);
                if (nearest.found) any = true;
            });
        },
        progress_);
    vanished_ = !any;
}

void SurfaceBand::count_inside() {
    inside_ = 0;
    auto it = tree_->cbeginValueOff();
    it.setMaxDepth(FloatTree::ValueOffCIter::LEAF_DEPTH - 1);
    for (; it; ++it)
        if (*it < 0) inside_ += it.getVoxelCount();
    for (auto leaf = tree_->cbeginLeaf(); leaf; ++leaf)
        for (auto v = leaf->cbeginValueOff(); v; ++v) inside_ += *v < 0;
}

SurfaceBand::Measures SurfaceBand::measures() const {
    constexpr double narrow = 1.5, wide = 3;  // the error is proportional to the square of the width
    struct Sums {
        double volume = 0, area = 0;
    };
    const Sums sums = fixed_order_reduce(
        layout_.brick_count(), 16, Sums{},
        [&](std::size_t begin, std::size_t end) {
            Sums s;
            for (std::size_t i = begin; i < end; ++i)
                for (std::size_t x = 0; x < 8; ++x)
                    for (std::uint64_t word = layout_.mask(i)[x]; word; word &= word - 1) {
                        const double phi =
                            phi_.brick(i)[64 * x + static_cast<std::size_t>(__builtin_ctzll(word))];
                        s.volume += (4 * inside(phi, narrow) - inside(phi, wide)) / 3;
                        s.area += (4 * delta(phi, narrow) - delta(phi, wide)) / 3;
                    }
            return s;
        },
        [](Sums& a, const Sums& b) {
            a.volume += b.volume;
            a.area += b.area;
        });
    return {static_cast<double>(inside_) + sums.volume, sums.area};
}

void SurfaceBand::write(FloatGrid& level_set, double half_width) const {
    const double voxel = level_set.voxelSize()[0];
    const auto width = static_cast<float>(half_width);
    if (vanished_) {
        level_set.setTree(std::make_shared<FloatTree>(width));
        return;
    }
    auto tree = std::make_shared<FloatTree>(*tree_);
    stencil::store(layout_, phi_.brick(0), 0, *tree);
    openvdb::tree::LeafManager<FloatTree> leaves(*tree);
    parallel_for(leaves.leafCount(), 16, [&](std::size_t i) {
        for (auto it = leaves.leaf(i).beginValueAll(); it; ++it) {
            const auto v = static_cast<float>(*it * voxel);
            const bool on = it.isValueOn() && std::abs(v) < width;
            it.setValue(on ? v : v < 0 ? -width : width);
            it.setValueOn(on);
        }
    });
    openvdb::tools::changeLevelSetBackground(*tree, width);
    openvdb::tools::pruneLevelSet(*tree);
    level_set.setTree(tree);
}

}  // namespace vdbgeo
