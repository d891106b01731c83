#include "vdbgeo/flow/geometric_rate.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "vdbgeo/stencil/tiles.h"

namespace vdbgeo {
namespace {

using stencil::BlockLayout;
using stencil::Tile;

/// body(at, n) for the rows of what is worked on, grown by `before` and `after` voxels along each axis: n
/// voxels from `at`.
template <class Body>
void for_rows(const Tile& t, const std::array<int, 3>& before, const std::array<int, 3>& after,
              const Body& body) {
    const openvdb::Coord &first = t.work.min(), &last = t.work.max();
    for (int x = first.x() - before[0]; x <= last.x() + after[0]; ++x)
        for (int y = first.y() - before[1]; y <= last.y() + after[1]; ++y) {
            const stencil::RowSpan s = t.span(x, y);
            const int begin = std::max<int>(s.begin, first.z() - before[2]),
                      end = std::min<int>(s.end, last.z() + 1 + after[2]);
            if (begin < end) body(t.at(x, y, begin), static_cast<std::ptrdiff_t>(end - begin));
        }
}

std::array<int, 3> all_axes(int n) { return {n, n, n}; }
std::array<int, 3> one_axis(int a) { return {a == 0, a == 1, a == 2}; }
std::array<int, 3> other_axes(int a) { return {a != 0, a != 1, a != 2}; }

/// The right side of Eq 5 in a tile. Its scratch: w and another (L^q S), ∂w along the axes, coefficients of
/// faces, √g, sums of coefficients.
class RightSide {
 public:
    static constexpr int scratch = 8;

    RightSide(const GeometricFlowOptions& options, const Vec3d& weights) : order_(options.order) {
        for (std::size_t a = 0; a < 3; ++a) {
            weight_[a] = static_cast<float>(weights[static_cast<int>(a)]);
            root_[a] = std::sqrt(weight_[a]);
        }
        per_scale_ = static_cast<float>(1 / options.scale);
        fidelity_ = static_cast<float>(options.fidelity);
        pressure_ = static_cast<float>(options.pressure);
    }

    /// out = S_t. Returns the largest row sum √g Σ w/√g over the faces of a voxel.
    double operator()(Tile& t) const {
        const std::ptrdiff_t steps[3] = {t.stride_x, t.stride_y, 1};
        const float* w = power(t, steps);
        float *faces = t.scratch[5], *root_g = t.scratch[6], *sums = t.scratch[7], *out = t.out[0];
        for (std::size_t a = 0; a < 3; ++a) slope(t, w, a, steps[a]);
        area_element(t, root_g);
        for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
            std::fill_n(sums + at, n, 0.0f);
            std::fill_n(out + at, n, 0.0f);
        });
        for (std::size_t a = 0; a < 3; ++a) {
            face_coefficients(t, w, a, steps[a], faces);
            const std::ptrdiff_t s = steps[a];
            for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
                for (std::ptrdiff_t i = at; i < at + n; ++i) {
                    out[i] += faces[i] * (w[i + s] - w[i]) - faces[i - s] * (w[i] - w[i - s]);
                    sums[i] += faces[i] + faces[i - s];
                }
            });
        }
        float most = 0;
        for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
            for (std::ptrdiff_t i = at; i < at + n; ++i) {
                out[i] *= root_g[i];
                most = std::max(most, sums[i] * root_g[i]);
            }
        });
        add_pressure(t, steps, out);
        for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
            for (std::ptrdiff_t i = at; i < at + n; ++i) out[i] *= t.active[i];
        });
        return most;
    }

 private:
    /// w = L^q S, on the cell and one voxel around it.
    const float* power(Tile& t, const std::ptrdiff_t* steps) const {
        const float* from = t.in[0];
        for (int q = 0; q < order_; ++q) {
            float* to = t.scratch[static_cast<std::size_t>(q & 1)];
            const std::array<int, 3> around = all_axes(order_ - q);
            for_rows(t, around, around, [&](std::ptrdiff_t at, std::ptrdiff_t n) {
                const float* on = t.active;
                for (std::ptrdiff_t i = at; i < at + n; ++i) {
                    float sum = 0;
                    for (std::size_t a = 0; a < 3; ++a) {
                        const std::ptrdiff_t s = steps[a];
                        sum += weight_[a] *
                               (on[i - s] * (from[i] - from[i - s]) + on[i + s] * (from[i] - from[i + s]));
                    }
                    to[i] = on[i] * sum;
                }
            });
            from = to;
        }
        return from;
    }

    /// Central difference of w along an axis, in units of the scale: in the cell and beside it along the
    /// others.
    void slope(Tile& t, const float* w, std::size_t a, std::ptrdiff_t s) const {
        float* to = t.scratch[2 + a];
        const float* on = t.active;
        const float half = 0.5f * root_[a] * per_scale_;
        const std::array<int, 3> around = other_axes(static_cast<int>(a));
        for_rows(t, around, around, [&](std::ptrdiff_t at, std::ptrdiff_t n) {
            for (std::ptrdiff_t i = at; i < at + n; ++i)
                to[i] = half * (on[i + s] * (w[i + s] - w[i]) + on[i - s] * (w[i] - w[i - s]));
        });
    }

    void area_element(Tile& t, float* root_g) const {
        const float *x = t.scratch[2], *y = t.scratch[3], *z = t.scratch[4];
        for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
            for (std::ptrdiff_t i = at; i < at + n; ++i)
                root_g[i] = std::sqrt(1 + x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
        });
    }

    /// weight/√g of the face between a voxel and the next along the axis, 0 where one of them is not active.
    void face_coefficients(Tile& t, const float* w, std::size_t a, std::ptrdiff_t s, float* faces) const {
        const float *p = t.scratch[2 + (a + 1) % 3], *q = t.scratch[2 + (a + 2) % 3], *on = t.active;
        const float normal = root_[a] * per_scale_;
        // A row's span may begin behind the face that the row shares with the one before: faces are 0 there.
        const std::array<int, 3> before = one_axis(static_cast<int>(a));
        const openvdb::Coord &first = t.work.min(), &last = t.work.max();
        for (int x = first.x() - before[0]; x <= last.x(); ++x)
            for (int y = first.y() - before[1]; y <= last.y(); ++y) {
                const std::ptrdiff_t row = t.at(x, y, 0);
                for (std::ptrdiff_t i = row + first.z() - before[2]; i <= row + last.z(); ++i) {
                    const float both = on[i] * on[i + s];
                    const float d = both * normal * (w[i + s] - w[i]);
                    const float u = both * 0.5f * (p[i] + p[i + s]), v = both * 0.5f * (q[i] + q[i + s]);
                    faces[i] = both * weight_[a] / std::sqrt(1 + d * d + u * u + v * v);
                }
            }
    }

    /// p |∇S| by Godunov's upwind differences, β (X − S).
    void add_pressure(Tile& t, const std::ptrdiff_t* steps, float* out) const {
        const float *in = t.in[0], *on = t.active;
        if (pressure_ != 0) {
            const float sign = pressure_ > 0 ? 1.0f : -1.0f;  // upward: from larger neighbours
            for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
                for (std::ptrdiff_t i = at; i < at + n; ++i) {
                    float sum = 0;
                    for (std::size_t a = 0; a < 3; ++a) {
                        const std::ptrdiff_t s = steps[a];
                        const float next = sign * on[i + s] * (in[i + s] - in[i]);
                        const float last = sign * on[i - s] * (in[i - s] - in[i]);
                        const float up = std::max(0.0f, std::max(next, last));
                        sum += weight_[a] * up * up;
                    }
                    out[i] += pressure_ * std::sqrt(sum);
                }
            });
        }
        if (fidelity_ == 0) return;
        const float* target = t.in[1];
        for_rows(t, all_axes(0), all_axes(0), [&](std::ptrdiff_t at, std::ptrdiff_t n) {
            for (std::ptrdiff_t i = at; i < at + n; ++i) out[i] += fidelity_ * (target[i] - in[i]);
        });
    }

    int order_;
    std::array<float, 3> weight_, root_;
    float per_scale_, fidelity_, pressure_;
};

}  // namespace

GeometricRate::GeometricRate(const GeometricFlowOptions& options, const Vec3d& weights)
    : options_(options), weights_(weights) {}

double GeometricRate::operator()(const BlockLayout& layout, const float* state, const float* input,
                                 float* rate) const {
    const RightSide right_side(options_, weights_);
    stencil::TileFields fields;
    fields.in = {state};
    if (options_.fidelity != 0) fields.in.push_back(input);
    fields.out = {rate};
    fields.halo = reach();
    fields.scratch = RightSide::scratch;
    std::mutex mutex;
    double most = 0;
    stencil::for_each_tile(layout, fields, [&](Tile& t) {
        const double here = right_side(t);
        const std::lock_guard<std::mutex> lock(mutex);
        most = std::max(most, here);
    });
    return most;
}

double GeometricRate::bound(double row_sum) const {
    const double rate = 2 * row_sum * std::pow(4 * weights_.sum(), options_.order) + options_.fidelity +
                        2 * std::abs(options_.pressure) * std::sqrt(weights_.sum());
    return 2 / rate;
}

}  // namespace vdbgeo
