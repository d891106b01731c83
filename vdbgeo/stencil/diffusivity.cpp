#include "vdbgeo/stencil/diffusivity.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "vdbgeo/stencil/plane_kernels.h"
#include "vdbgeo/stencil/tiles.h"

namespace vdbgeo::stencil {
namespace {

std::array<float, 3> roots(const Vec3d& weights) {
    return {static_cast<float>(std::sqrt(weights[0])), static_cast<float>(std::sqrt(weights[1])),
            static_cast<float>(std::sqrt(weights[2]))};
}

/// Window sums over a tile, plane by plane: along z, then y, and along x over the last 2r+1 planes.
class WindowSums {
 public:
    WindowSums(const Tile& t, int radius, int quantities)
        : tile_(t),
          r_(radius),
          width_(2 * radius + 1),
          row_(static_cast<std::size_t>(t.stride_y)),
          first_(t.work.min().y()),
          rows_(t.work.dim().y()),
          along_z_(static_cast<std::size_t>(rows_ + 2 * r_) * row_) {
        planes_.resize(static_cast<std::size_t>(quantities));
        for (auto& q : planes_)
            q.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(rows_) * row_);
        sums_.resize(static_cast<std::size_t>(quantities), std::vector<double>(row_));
    }

    /// Adds plane x of an array that starts a row at z = −lead.
    void add_plane(int quantity, int x, const float* rows, bool squared) {
        const Kernels& k = kernels();
        for (int y = first_ - r_; y < first_ + rows_ + r_; ++y)
            k.window_sum(row_, r_, rows + y * tile_.stride_y, squared, z_row(y));
        const double* in[2 * 8 + 1];
        for (int y = first_; y < first_ + rows_; ++y) {
            for (int j = 0; j < width_; ++j) in[j] = z_row(y - r_ + j);
            k.sum_rows(row_, width_, in, plane_row(quantity, x, y));
        }
    }
    /// The sums over the window around row (x, y).
    const double* row(int quantity, int x, int y) {
        const double* in[2 * 8 + 1];
        for (int j = 0; j < width_; ++j) in[j] = plane_row(quantity, x - r_ + j, y);
        std::vector<double>& out = sums_[static_cast<std::size_t>(quantity)];
        kernels().sum_rows(row_, width_, in, out.data());
        return out.data();
    }

 private:
    double* z_row(int y) { return along_z_.data() + static_cast<std::size_t>(y - first_ + r_) * row_; }
    double* plane_row(int quantity, int x, int y) {
        const int slot = (x + width_) % width_;
        return planes_[static_cast<std::size_t>(quantity)].data() +
               static_cast<std::size_t>(slot * rows_ + y - first_) * row_;
    }

    const Tile& tile_;
    int r_, width_;
    std::size_t row_;
    int first_, rows_;
    std::vector<double> along_z_;
    std::vector<std::vector<double>> planes_, sums_;
};

/// One tile. Rows are gone through from z = −lead on, where they begin in memory.
class TileDiffusivity {
 public:
    TileDiffusivity(Tile& t, const Diffusivity& o, const std::array<float, 3>& scale)
        : t_(t), o_(o), scale_(scale), lead_(t.lead), row_(static_cast<std::size_t>(t.stride_y)) {}

    void run() {
        const int components = o_.radius == 0 ? 0 : o_.of_gradient ? 3 : 1;
        const int r = o_.radius;
        WindowSums sums(t_, std::max(r, 1), components + 2);
        std::vector<float> variance(row_, static_cast<float>(std::max(o_.sigma_squared, o_.floor)));
        for (int x = t_.work.min().x() - r; x <= t_.work.max().x() + r; ++x) {
            gradient(x, components == 3);
            if (components) add(sums, x, components);
            if (const int done = x - r; done >= t_.work.min().x()) finish(sums, done, components, variance);
        }
    }

 private:
    float* plane(float* array, int x) const { return array + t_.at(x, 0, -lead_); }

    /// Components and square of the gradient, in the tile's scratch arrays 0…2 and 3.
    void gradient(int x, bool components) const {
        const int margin = o_.of_gradient ? o_.radius : 0;
        const float* u = plane(t_.in[0], x);
        const float* a = plane(t_.active, x);
        const Planes pu{u - t_.stride_x, u, u + t_.stride_x}, pa{a - t_.stride_x, a, a + t_.stride_x};
        const int first = t_.work.min().y() - margin, last = t_.work.max().y() + margin;
        const std::vector<RowSpan> all(static_cast<std::size_t>(BlockLayout::size_y + 2 * margin),
                                       {0, static_cast<std::int16_t>(t_.stride_y)});
        const PlaneRange range{first, last + 1, t_.stride_y, all.data() + margin};
        float* g[3];
        for (int c = 0; c < 3; ++c) g[c] = plane(t_.scratch[static_cast<std::size_t>(c)], x);
        kernels().gradient(range, pu, pa, scale_.data(), components ? g : nullptr, plane(t_.scratch[3], x));
    }
    void add(WindowSums& sums, int x, int components) const {
        sums.add_plane(0, x, plane(t_.active, x), false);
        if (components == 1) {
            sums.add_plane(1, x, plane(t_.in[0], x), true);
            sums.add_plane(2, x, plane(t_.in[0], x), false);
            return;
        }
        sums.add_plane(1, x, plane(t_.scratch[3], x), false);
        for (int c = 0; c < 3; ++c)
            sums.add_plane(2 + c, x, plane(t_.scratch[static_cast<std::size_t>(c)], x), false);
    }
    void finish(WindowSums& sums, int x, int components, std::vector<float>& variance) const {
        for (int y = t_.work.min().y(); y <= t_.work.max().y(); ++y) {
            if (components) {
                const double* means[3] = {};
                for (int c = 0; c < components; ++c) means[c] = sums.row(2 + c, x, y);
                kernels().variance(row_, sums.row(0, x, y), sums.row(1, x, y), means, components,
                                   static_cast<float>(o_.scale), static_cast<float>(o_.floor),
                                   variance.data());
            }
            const std::ptrdiff_t at = t_.at(x, y, -lead_);
            kernels().edge_stopping(row_, t_.scratch[3] + at, variance.data(), t_.active + at,
                                    static_cast<float>(o_.factor), t_.out[0] + at);
        }
    }

    Tile& t_;
    const Diffusivity& o_;
    const std::array<float, 3>& scale_;
    int lead_;
    std::size_t row_;
};

}  // namespace

void diffusivity(const BlockLayout& layout, const float* u, const Vec3d& weights, const Diffusivity& options,
                 float* out) {
    const std::array<float, 3> scale = roots(weights);
    TileFields fields;
    fields.in = {u};
    fields.out = {out};
    fields.halo = options.radius + 1;
    fields.scratch = 4;
    for_each_tile(layout, fields, [&](Tile& t) { TileDiffusivity(t, options, scale).run(); });
}

namespace {

/// A sum in as many parts as a vector has numbers, so that they add up side by side.
struct RowSum {
    double part[lanes] = {};
    void add(const float* row, int n) {
        for (int i = 0; i < n; i += lanes)
            for (int k = 0; k < lanes; ++k) part[k] += static_cast<double>(row[i + k]);
    }
    double value() const {
        double sum = 0;
        for (const double p : part) sum += p;
        return sum;
    }
};

}  // namespace

/// Sums are rounded within the leaves of a cell that have the same y.
void GradientTotal::add_tile(Tile& t, const float* scale) {
    constexpr int dim = 8;
    const std::vector<RowSpan> all(BlockLayout::size_y, {0, static_cast<std::int16_t>(t.stride_y)});
    for (int begin = t.work.min().y(); begin <= t.work.max().y(); begin += dim) {
        RowSum square, component[3];
        for (int x = 0; x < BlockLayout::size_x; ++x) {
            const std::ptrdiff_t at = t.at(x, 0, -t.lead);
            const Planes pu{t.in[0] + at - t.stride_x, t.in[0] + at, t.in[0] + at + t.stride_x};
            const Planes pa{t.active + at - t.stride_x, t.active + at, t.active + at + t.stride_x};
            float* g[3] = {t.scratch[0] + at, t.scratch[1] + at, t.scratch[2] + at};
            kernels().gradient({begin, begin + dim, t.stride_y, all.data()}, pu, pa, scale, g,
                               t.scratch[3] + at);
            for (int y = begin; y < begin + dim; ++y) {
                square.add(t.scratch[3] + t.at(x, y, 0), BlockLayout::size_z);
                for (std::size_t c = 0; c < 3; ++c)
                    component[c].add(t.scratch[c] + t.at(x, y, 0), BlockLayout::size_z);
            }
        }
        square_.add(square.value());
        for (std::size_t c = 0; c < 3; ++c) component_[c].add(component[c].value());
    }
}

void GradientTotal::add(const BlockLayout& layout, const float* u) {
    const std::array<float, 3> scale = roots(weights_);
    TileFields fields;
    fields.in = {u};
    fields.halo = 1;
    fields.scratch = 4;
    tbb::enumerable_thread_specific<GradientTotal> parts(weights_);
    for_each_tile(layout, fields, [&](Tile& t) { parts.local().add_tile(t, scale.data()); });
    for (const GradientTotal& part : parts) {
        square_.add(part.square_);
        for (std::size_t c = 0; c < 3; ++c) component_[c].add(part.component_[c]);
    }
    active_ += layout.active_count();
}

double GradientTotal::variance(Team* team) const {
    GradientTotal all = *this;
    std::vector<std::uint64_t> count{active_};
    if (team) {
        all.square_.add_up(*team);
        for (ExactSum& c : all.component_) c.add_up(*team);
        team->add_up(count);
    }
    const double n = std::max(1.0, static_cast<double>(count[0]));
    double means = 0;
    for (const ExactSum& c : all.component_) means += c.value() / n * (c.value() / n);
    return std::max(0.0, all.square_.value() / n - means);
}

double gradient_variance(const BlockLayout& layout, const float* u, const Vec3d& weights, Team* team) {
    GradientTotal total(weights);
    total.add(layout, u);
    return total.variance(team);
}

}  // namespace vdbgeo::stencil
