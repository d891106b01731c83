#include "vdbgeo/measure/smoothed_view.h"

#include <algorithm>
#include <cmath>

#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

/// Up to here the gaussian is differentiated as it is: 16 weights an axis.
constexpr double widest_direct = 2;
/// The part of a wider one that is differentiated: 12 weights.
constexpr double narrow_part = 1.5;

std::size_t volume(const Vec3i& size) {
    return static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
           static_cast<std::size_t>(size.z());
}

}  // namespace

SampleRange::SampleRange(const Frame& frame)
    : low(Vec3i::Constant(-(1 << 30))), high(Vec3i::Constant(1 << 30)) {
    if (!frame.bounded()) return;
    low.setZero();
    high = frame.size - Vec3i::Ones();
}

SmoothedView::Axis SmoothedView::axis_for(double sigma) {
    const bool two = sigma > widest_direct;
    const double narrow = two ? narrow_part : sigma;
    return {GaussianWindow(narrow),
            GaussianWindow(two ? std::sqrt(sigma * sigma - narrow * narrow) : narrow_part), two};
}

int SmoothedView::edge_for(const Vec3d& sigma) {
    int edge = 8;
    while (sigma.maxCoeff() > widest_direct && edge < 32 && edge < 4 * sigma.maxCoeff()) edge *= 2;
    return edge;
}

SmoothedView::SmoothedView(const DensityMap& map, const Vec3d& sigma)
    : reader_(map.grid->getConstAccessor()),
      range_(map.frame),
      axes_{axis_for(sigma.x()), axis_for(sigma.y()), axis_for(sigma.z())},
      edge_(edge_for(sigma)) {
    int longest = 0;
    for (const Axis& a : axes_) longest = std::max({longest, a.narrow.count(), a.wide.count()});
    weights_.resize(9 * static_cast<std::size_t>(longest));
}

/// Leaf by leaf; 0 outside the box, where weights are 0 too.
void SmoothedView::gather(const Vec3i& low, const Vec3i& size) {
    low_ = low;
    size_ = size;
    cube_.assign(volume(size), 0.0);
    const Vec3i begin = low.cwiseMax(range_.low), end = (low + size).cwiseMin(range_.high + Vec3i::Ones());
    for (int bx = begin.x() & ~7; bx < end.x(); bx += leaf::dim)
        for (int by = begin.y() & ~7; by < end.y(); by += leaf::dim)
            for (int bz = begin.z() & ~7; bz < end.z(); bz += leaf::dim) {
                const openvdb::Coord origin(bx, by, bz);
                const leaf::Leaf* const node = reader_.probeConstLeaf(origin);
                const float* const in = node ? node->buffer().data() : nullptr;
                const double tile = in ? 0 : static_cast<double>(reader_.getValue(origin));
                const int z0 = std::max(bz, begin.z()), z1 = std::min(bz + leaf::dim, end.z());
                for (int x = std::max(bx, begin.x()); x < std::min(bx + leaf::dim, end.x()); ++x)
                    for (int y = std::max(by, begin.y()); y < std::min(by + leaf::dim, end.y()); ++y) {
                        double* const to = &cube_[static_cast<std::size_t>(
                                                      ((x - low.x()) * size.y() + y - low.y()) * size.z()) -
                                                  static_cast<std::size_t>(low.z())];
                        const float* const from = in ? in + leaf::offset(x & 7, y & 7, 0) - bz : nullptr;
                        for (int z = z0; z < z1; ++z) to[z] = from ? static_cast<double>(from[z]) : tile;
                    }
            }
}

/// One axis of cube_ smoothed; the cube loses the window's width there.
void SmoothedView::smooth(int axis) {
    const GaussianWindow& window = axes_[static_cast<std::size_t>(axis)].wide;
    const int n = window.count();
    Vec3i size = size_;
    size[axis] -= n - 1;
    other_.assign(volume(size), 0.0);
    // Rows along the axis have `inner` values between neighbours; what lies outside them is looped over.
    std::size_t inner = 1, outer = 1;
    for (int a = axis + 1; a < 3; ++a) inner *= static_cast<std::size_t>(size[a]);
    for (int a = 0; a < axis; ++a) outer *= static_cast<std::size_t>(size[a]);
    const auto before = static_cast<std::size_t>(size_[axis]), after = static_cast<std::size_t>(size[axis]);
    double* const w = weights_.data();
    const int low = low_[axis] + n / 2 - 1;
    for (std::size_t i = 0; i < after; ++i) {
        const int at = low + static_cast<int>(i);
        if (at < range_.low[axis] || at > range_.high[axis]) continue;
        if (!window.fill(at, range_.low[axis], range_.high[axis], w, w + n, w + 2 * n)) continue;
        for (std::size_t o = 0; o < outer; ++o) {
            double* const to = &other_[(o * after + i) * inner];
            for (int k = 0; k < n; ++k) {
                const double* const from = &cube_[(o * before + i + static_cast<std::size_t>(k)) * inner];
                const double weight = w[k];
                for (std::size_t j = 0; j < inner; ++j) to[j] += weight * from[j];
            }
        }
    }
    cube_.swap(other_);
    low_[axis] = low;
    size_ = size;
}

void SmoothedView::move_to(const openvdb::Coord& corner) {
    corner_ = corner;
    Vec3i low, size;
    for (int a = 0; a < 3; ++a) {
        const Axis& axis = axes_[static_cast<std::size_t>(a)];
        low[a] = axis.narrow.first(corner[a]);
        size[a] = edge_ + axis.narrow.count() - 1;
        if (!axis.smoothed) continue;
        low[a] = axis.wide.first(low[a]);
        size[a] += axis.wide.count() - 1;
    }
    gather(low, size);
    for (int a = 0; a < 3; ++a)
        if (axes_[static_cast<std::size_t>(a)].smoothed) smooth(a);
}

bool SmoothedView::has_few_values(std::size_t most) const {
    std::vector<double> seen;
    for (const double v : cube_) {
        if (std::isnan(v) || std::find(seen.begin(), seen.end(), v) != seen.end()) continue;
        if (seen.size() == most) return false;
        seen.push_back(v);
    }
    return true;
}

bool SmoothedView::holds(const Vec3d& index) const {
    for (int a = 0; a < 3; ++a)
        if (!(index[a] >= corner_[a] && index[a] < corner_[a] + edge_) || index[a] < range_.low[a] - 0.5 ||
            index[a] > range_.high[a] + 0.5)
            return false;
    return true;
}

bool SmoothedView::derivatives(const Vec3d& index, Derivatives& out) const {
    double* w[3];
    int n[3], at[3];
    double* next = weights_.data();
    for (int a = 0; a < 3; ++a) {
        const GaussianWindow& window = axes_[static_cast<std::size_t>(a)].narrow;
        n[a] = window.count();
        at[a] = window.first(index[a]) - low_[a];
        w[a] = next;
        next += 3 * n[a];
        if (!window.fill(index[a], range_.low[a], range_.high[a], w[a], w[a] + n[a], w[a] + 2 * n[a]))
            return false;
    }
    constexpr int step = GaussianWindow::step;
    const auto plane = static_cast<std::ptrdiff_t>(size_.y()) * size_.z();
    double s000 = 0, s100 = 0, s010 = 0, s001 = 0, s200 = 0, s020 = 0, s002 = 0, s110 = 0, s101 = 0, s011 = 0;
    for (int z = 0; z < n[2]; z += step) {
        double t[6][step] = {};  // sums over x and y: 00, 01, 02, 10, 11, 20
        for (int y = 0; y < n[1]; ++y) {
            double r[3][step] = {};
            const double* from = cube_.data() + at[0] * plane + (at[1] + y) * size_.z() + at[2] + z;
            const double* const wx = w[0];
            for (int x = 0; x < n[0]; ++x, from += plane)
                for (int k = 0; k < step; ++k) {
                    r[0][k] += wx[x] * from[k];
                    r[1][k] += wx[n[0] + x] * from[k];
                    r[2][k] += wx[2 * n[0] + x] * from[k];
                }
            const double y0 = w[1][y], y1 = w[1][n[1] + y], y2 = w[1][2 * n[1] + y];
            for (int k = 0; k < step; ++k) {
                t[0][k] += y0 * r[0][k];
                t[1][k] += y1 * r[0][k];
                t[2][k] += y2 * r[0][k];
                t[3][k] += y0 * r[1][k];
                t[4][k] += y1 * r[1][k];
                t[5][k] += y0 * r[2][k];
            }
        }
        for (int k = 0; k < step; ++k) {
            const double z0 = w[2][z + k], z1 = w[2][n[2] + z + k], z2 = w[2][2 * n[2] + z + k];
            s000 += z0 * t[0][k];
            s001 += z1 * t[0][k];
            s002 += z2 * t[0][k];
            s010 += z0 * t[1][k];
            s011 += z1 * t[1][k];
            s020 += z0 * t[2][k];
            s100 += z0 * t[3][k];
            s101 += z1 * t[3][k];
            s110 += z0 * t[4][k];
            s200 += z0 * t[5][k];
        }
    }
    out.value = s000;
    out.gradient = Vec3d(s100, s010, s001);
    out.hessian << s200, s110, s101, s110, s020, s011, s101, s011, s002;
    return std::isfinite(s000) && out.gradient.allFinite() && out.hessian.allFinite();
}

}  // namespace vdbgeo
