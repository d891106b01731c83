#include "vdbgeo/flow/level_set_operators.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

using stencil::BlockField;
using stencil::BlockLayout;
using stencil::Tile;

constexpr double sharpest = 1;  // principal curvature that the lattice can show, 1/voxel

struct Shape {
    double rate;       // |∇φ| κ
    double curvature;  // κ = k1 + k2
    double gaussian;   // K = k1 k2
};

/// Curvatures of the level set through a voxel (Goldman 2005); NaN where a neighbour is missing.
Shape shape_at(const DenseWindow& w, std::ptrdiff_t at) {
    const float* p = w.data + at;
    const std::ptrdiff_t X = w.stride_x, Y = w.stride_y, Z = 1;
    const auto second = [&](std::ptrdiff_t a) { return static_cast<double>(p[a]) + p[-a] - 2.0 * p[0]; };
    const auto first = [&](std::ptrdiff_t a) { return (static_cast<double>(p[a]) - p[-a]) / 2; };
    const auto mixed = [&](std::ptrdiff_t a, std::ptrdiff_t b) {
        return (static_cast<double>(p[a + b]) + p[-a - b] - p[a - b] - p[b - a]) / 4;
    };
    const double x = first(X), y = first(Y), z = first(Z);
    const double xx = second(X), yy = second(Y), zz = second(Z);
    const double xy = mixed(X, Y), xz = mixed(X, Z), yz = mixed(Y, Z);
    const double g2 =
        x * x + y * y + z * z + 1e-6;  // where φ has a crest, its Laplacian remains (Evans & Spruck)
    const double along = x * x * xx + y * y * yy + z * z * zz + 2 * (x * y * xy + x * z * xz + y * z * yz);
    const double adjoint =
        x * x * (yy * zz - yz * yz) + y * y * (xx * zz - xz * xz) + z * z * (xx * yy - xy * xy) +
        2 * (x * y * (xz * yz - xy * zz) + x * z * (xy * yz - xz * yy) + y * z * (xy * xz - yz * xx));
    Shape s;
    s.rate = xx + yy + zz - along / g2;
    s.curvature = s.rate / std::sqrt(g2);
    if (std::abs(s.curvature) > 2 * sharpest) s.curvature = std::copysign(2 * sharpest, s.curvature);
    s.gaussian = adjoint / (g2 * g2);
    return s;
}

/// A field that body(shape, at) makes from the shape at each voxel.
template <class Body>
BlockField from_shapes(const SurfaceBand& band, const Body& body) {
    BlockField out(band.layout().brick_count());
    stencil::TileFields fields;
    fields.in = {band.phi()};
    fields.out = {out.brick(0)};
    fields.scratch = 1;
    stencil::for_each_tile(band.layout(), fields, [&](Tile& t) {
        const DenseWindow phi = window_of(t, 0, 0);
        for_active(t, [&](int, int, int, std::ptrdiff_t at) {
            t.out[0][at] = static_cast<float>(body(shape_at(phi, at)));
        });
    });
    return out;
}

/// field(nearest point of the surface) at each voxel; `only_missing`: where the field has no value of its
/// own.
BlockField extend(const SurfaceBand& band, const BlockField& field, bool only_missing = false) {
    BlockField out(band.layout().brick_count());
    const auto n = band.normal();
    stencil::TileFields fields;
    fields.in = {field.brick(0), band.phi(), n[0], n[1], n[2]};
    fields.out = {out.brick(0)};
    fields.halo = band.halo();
    fields.scratch = 1;
    stencil::for_each_tile(band.layout(), fields, [&](Tile& t) {
        const DenseWindow values = window_of(t, 0, 0);
        for_active(t, [&](int x, int y, int z, std::ptrdiff_t at) {
            double v = values.data[at];
            if (!only_missing || std::isnan(v)) {
                const Vec3d normal(t.in[2][at], t.in[3][at], t.in[4][at]);
                v = interpolate(values, Vec3d(x, y, z) - t.in[1][at] * normal);
            }
            t.out[0][at] = std::isfinite(v) ? static_cast<float>(v) : 0.0f;
        });
    });
    return out;
}

/// factor · Δ(field) + other, NaN where a neighbour is missing.
BlockField laplacian_plus(const BlockLayout& layout, const BlockField& field, float factor,
                          const BlockField* other) {
    BlockField out(layout.brick_count());
    stencil::TileFields fields;
    fields.in = {field.brick(0)};
    if (other) fields.in.push_back(other->brick(0));
    fields.out = {out.brick(0)};
    fields.scratch = 1;
    stencil::for_each_tile(layout, fields, [&](Tile& t) {
        const DenseWindow w = window_of(t, 0, 0);
        for_active(t, [&](int, int, int, std::ptrdiff_t at) {
            const float* p = w.data + at;
            const float sum = p[w.stride_x] + p[-w.stride_x] + p[w.stride_y] + p[-w.stride_y] + p[1] + p[-1];
            t.out[0][at] = factor * (sum - 6 * p[0]) + (other ? t.in[1][at] : 0.0f);
        });
    });
    return out;
}

/// out = p + a L² p.
void apply(const BlockLayout& layout, double a, const BlockField& p, BlockField& out) {
    stencil::TileFields fields;
    fields.in = {p.brick(0)};
    fields.out = {out.brick(0)};
    fields.halo = 2;
    fields.scratch = 1;
    const auto factor = static_cast<float>(a);
    stencil::for_each_tile(layout, fields, [factor](Tile& t) {
        const std::ptrdiff_t steps[6] = {t.stride_x, -t.stride_x, t.stride_y, -t.stride_y, 1, -1};
        const float* on = t.active;
        const auto negative_laplacian = [&](const float* u, std::ptrdiff_t at) {
            float sum = 0;
            for (const std::ptrdiff_t s : steps) sum += on[at + s] * (u[at] - u[at + s]);
            return sum;
        };
        float* once = t.scratch[0];
        for (int x = -1; x <= BlockLayout::size_x; ++x)
            for (int y = -1; y <= BlockLayout::size_y; ++y) {
                const stencil::RowSpan s = t.span(x, y);
                const int end = std::min<int>(s.end, BlockLayout::size_z + 1);
                for (int z = std::max<int>(s.begin, -1); z < end; ++z)
                    once[t.at(x, y, z)] = negative_laplacian(t.in[0], t.at(x, y, z));
            }
        for_active(t, [&](int, int, int, std::ptrdiff_t at) {
            t.out[0][at] = t.in[0][at] + factor * negative_laplacian(once, at);
        });
    });
}

std::size_t size_of(const BlockField& f) { return f.bricks() * BlockField::brick_size; }
constexpr std::size_t sum_block = 64 * BlockField::brick_size;

double dot(const BlockField& a, const BlockField& b) {
    const float *p = a.brick(0), *q = b.brick(0);
    return fixed_order_reduce(
        size_of(a), sum_block, 0.0,
        [=](std::size_t begin, std::size_t end) {
            double sum = 0;
            for (std::size_t i = begin; i < end; ++i) sum += static_cast<double>(p[i]) * q[i];
            return sum;
        },
        [](double& total, double part) { total += part; });
}

/// body(i) for all floats of fields like f.
template <class Body>
void for_floats(const BlockField& f, const Body& body) {
    parallel_blocks(size_of(f), sum_block, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) body(i);
    });
}

}  // namespace

BlockField mean_curvature_rate(const SurfaceBand& band) {
    return extend(band, from_shapes(band, [](const Shape& s) { return s.rate; }), true);
}

BlockField surface_diffusion_speed(const SurfaceBand& band) {
    const BlockField curvature = extend(band, from_shapes(band, [](const Shape& s) { return s.curvature; }));
    return extend(band, laplacian_plus(band.layout(), curvature, 1, nullptr));
}

BlockField willmore_speed(const SurfaceBand& band) {
    const BlockField curvature = extend(band, from_shapes(band, [](const Shape& s) { return s.curvature; }));
    const BlockField bending = from_shapes(band, [](const Shape& s) {
        const double h = s.curvature / 2;
        // H² − K = ((k1 − k2)/2)². A NaN has to stay one.
        const double difference = h * h - s.gaussian;
        return 2 * h *
               (difference < 0                     ? 0
                : difference > sharpest * sharpest ? sharpest * sharpest
                                                   : difference);
    });
    return extend(band, laplacian_plus(band.layout(), curvature, 0.5f, &bending));
}

int solve_biharmonic(const BlockLayout& layout, double a, const BlockField& right_side, double tolerance,
                     double small, BlockField& delta) {
    constexpr int most = 2000;
    const std::size_t bricks = layout.brick_count();
    delta = BlockField(bricks);
    BlockField residual(bricks), direction(bricks), image(bricks);
    const float* b = right_side.brick(0);
    float *u = delta.brick(0), *r = residual.brick(0), *p = direction.brick(0), *m = image.brick(0);
    apply(layout, a, right_side, image);
    for_floats(delta, [=](std::size_t i) {
        u[i] = b[i];
        r[i] = p[i] = b[i] - m[i];
    });
    const double target = std::max(tolerance * tolerance * dot(right_side, right_side),
                                   small * small * static_cast<double>(layout.active_count()));
    double now = dot(residual, residual);
    for (int i = 0; i < most; ++i) {
        if (now <= target) return i;
        apply(layout, a, direction, image);
        const double step = now / dot(direction, image);
        if (!std::isfinite(step)) break;
        const auto s = static_cast<float>(step);
        for_floats(delta, [=](std::size_t k) {
            u[k] += s * p[k];
            r[k] -= s * m[k];
        });
        const double next = dot(residual, residual);
        const auto keep = static_cast<float>(next / now);
        for_floats(delta, [=](std::size_t k) { p[k] = r[k] + keep * p[k]; });
        now = next;
    }
    throw NumericalError(
        fmt::format("the implicit step was not solved to {} in {} iterations", tolerance, most));
}

double largest(const BlockField& field) {
    const float* v = field.brick(0);
    return fixed_order_reduce(
        size_of(field), sum_block, 0.0,
        [=](std::size_t begin, std::size_t end) {
            double most = 0;
            for (std::size_t i = begin; i < end; ++i) {
                if (!std::isfinite(v[i])) return std::numeric_limits<double>::infinity();
                most = std::max(most, static_cast<double>(std::abs(v[i])));
            }
            return most;
        },
        [](double& total, double part) { total = std::max(total, part); });
}

}  // namespace vdbgeo
