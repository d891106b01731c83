#include "vdbgeo/stencil/tile_gather.h"

#include <algorithm>

#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo::stencil {
namespace {

constexpr int dim = 8;

/// Rounds to minus infinity.
constexpr int floor_div(int a, int b) { return a >= 0 ? a / b : -((b - 1 - a) / b); }

}  // namespace

/// Of voxels [begin, end) with a halo; the plane begins `lead` voxels before the cell.
int TileGather::parts(int begin, int end, int halo, int lead, Part* out) {
    int n = 0;
    for (int l = floor_div(begin - halo, dim); l * dim < end + halo; ++l) {
        const int from = std::max(l * dim, begin - halo), to = std::min((l + 1) * dim, end + halo);
        out[n++] = {l, from - l * dim, to - l * dim, from + lead, (l + 1) * dim > begin && l * dim < end};
    }
    return n;
}

TileGather::TileGather(const BlockLayout& layout, BlockLayout::Run run, int halo)
    : layout_(layout), run_(run), halo_(halo), stride_(stride_of(halo)), kernels_(kernels()) {
    const auto& first = layout.cells()[static_cast<std::size_t>(run.first)];
    origin_ = first.origin;
    work_ = layout.work_in(first);
    work_.expand(layout.work_in(layout.cells()[static_cast<std::size_t>(run.last - 1)]));
    y_count_ = parts(y_begin(), y_end(), halo, halo, y_);
    // Whole leaves along z.
    const int z_begin = floor_div(work_.min().z() - origin_.z(), dim) * dim,
              z_end = (floor_div(work_.max().z() - origin_.z(), dim) + 1) * dim, lead = lead_of(halo);
    z_count_ = parts(z_begin, z_end, lead, lead, z_);
}

void TileGather::find_bricks(int layer, std::int32_t* to) const {
    const int cell_x =
        std::clamp(floor_div(layer * dim - origin_.x(), BlockLayout::size_x), -1, run_.last - run_.first);
    // The run's cell next to it: neighbours of the cells at the ends reach beyond the run.
    const int base = std::clamp(cell_x, 0, run_.last - run_.first - 1);
    const auto& cell = layout_.cells()[static_cast<std::size_t>(run_.first + base)];
    const int lx = layer & (BlockLayout::leaves_x - 1);
    const BlockLayout::Cell* around[3][3];
    for (int dy = -1; dy <= 1; ++dy)
        for (int dz = -1; dz <= 1; ++dz)
            around[dy + 1][dz + 1] = layout_.neighbor(cell, cell_x - base, dy, dz);
    for (int j = 0; j < y_count_; ++j)
        for (int k = 0; k < z_count_; ++k, ++to) {
            const int ly = y_[j].leaf, lz = z_[k].leaf;
            const int dy = floor_div(ly, BlockLayout::leaves_y), dz = floor_div(lz, BlockLayout::leaves_z);
            const BlockLayout::Cell* c = around[dy + 1][dz + 1];
            const int slot =
                (lx * BlockLayout::leaves_y + ly - dy * BlockLayout::leaves_y) * BlockLayout::leaves_z + lz -
                dz * BlockLayout::leaves_z;
            *to = c ? c->bricks[static_cast<std::size_t>(slot)] : BlockLayout::none;
        }
}

void TileGather::move_to(int x) {
    x_ = x;
    const int layer = floor_div(x, dim), count = y_count_ * z_count_;
    if (layer == layer_) return;
    if (layer == layer_ + 1)
        std::copy_n(next_bricks_, count, bricks_);
    else
        find_bricks(layer, bricks_);
    find_bricks(layer + 1, next_bricks_);
    layer_ = layer;
    regular_ = true;
    for (int i = 0; i < count; ++i) {
        if (bricks_[i] == BlockLayout::none) continue;
        regular_ = regular_ && layout_.full(static_cast<std::size_t>(bricks_[i]));
    }
    spans_known_ = false;
}

template <class Body>
void TileGather::for_leaves(const Body& body) const {
    const std::int32_t* brick = bricks_;
    for (int j = 0; j < y_count_; ++j)
        for (int k = 0; k < z_count_; ++k, ++brick) body(*brick, y_[j], z_[k]);
}

void TileGather::copy(const float* bricks, std::optional<float> absent, float* plane) const {
    const int in_leaf = x_ & (dim - 1);
    // Reading is bound by latency: ask for what the next plane needs.
    const std::int32_t* const soon = in_leaf < dim - 1 ? bricks_ : next_bricks_;
    const std::size_t soon_at = static_cast<std::size_t>(((in_leaf + 1) & (dim - 1)) * dim * dim);
    std::size_t i = 0;
    for_leaves([&](std::int32_t brick, const Part& y, const Part& z) {
        if (const std::int32_t n = soon[i++]; n != BlockLayout::none) {
            const float* p = bricks + static_cast<std::size_t>(n) * BlockField::brick_size + soon_at;
            for (int r = y.from / 2 * 2; r < y.to; r += 2) __builtin_prefetch(p + r * dim);
        }
        float* to = plane + y.at * stride_ + z.at;
        if (brick == BlockLayout::none) {
            if (!absent) return;
            for (int r = y.from; r < y.to; ++r, to += stride_) std::fill_n(to, dim, *absent);
            return;
        }
        kernels_.spread(bricks + static_cast<std::size_t>(brick) * BlockField::brick_size +
                            (in_leaf * dim + y.from) * dim,
                        y.to - y.from, to, stride_);
    });
}

void TileGather::activity(float on, float off, float* plane) const {
    for_leaves([&](std::int32_t brick, const Part& y, const Part& z) {
        float* to = plane + y.at * stride_ + z.at;
        if (brick == BlockLayout::none || layout_.full(static_cast<std::size_t>(brick))) {
            for (int r = y.from; r < y.to; ++r, to += stride_)
                std::fill_n(to, dim, brick == BlockLayout::none ? off : on);
            return;
        }
        const std::uint64_t word =
            layout_.mask(static_cast<std::size_t>(brick))[static_cast<std::size_t>(x_ & 7)];
        for (int r = y.from; r < y.to; ++r, to += stride_)
            for (int i = 0; i < dim; ++i) to[i] = word >> (r * dim + i) & 1 ? on : off;
    });
}

void TileGather::spans(RowSpan* spans) {
    if (!regular_) {
        find_spans(spans);
        return;
    }
    if (!spans_known_) find_spans(regular_spans_.data());
    spans_known_ = true;
    std::copy_n(regular_spans_.data(), rows_of(halo_), spans);
}

void TileGather::find_spans(RowSpan* spans) const {
    const auto all = static_cast<std::int16_t>(BlockLayout::size_z + 2 * lead_of(halo_));
    for (int r = 0; r < rows_of(halo_); ++r) spans[r] = {all, 0, true, 0};
    int active[BlockLayout::size_y + 2 * BlockLayout::max_halo] = {};
    for_leaves([&](std::int32_t brick, const Part& y, const Part& z) {
        if (brick == BlockLayout::none) return;
        const std::uint64_t word =
            layout_.mask(static_cast<std::size_t>(brick))[static_cast<std::size_t>(x_ & 7)];
        for (int r = y.from, at = y.at; r < y.to; ++r, ++at) {
            const unsigned bits = static_cast<unsigned>(word >> (r * dim)) & 0xff;
            if (!bits) continue;
            RowSpan& s = spans[at];
            s.begin = std::min(s.begin, static_cast<std::int16_t>(z.at + __builtin_ctz(bits)));
            s.vectors = static_cast<std::uint16_t>(s.vectors | 1u << (z.at / lanes));
            s.end = std::max(s.end, static_cast<std::int16_t>(z.at + 32 - __builtin_clz(bits)));
            active[at] += static_cast<int>((bits * 0x200040008001ULL & 0x111111111111111ULL) % 15);
        }
    });
    for (int r = 0; r < rows_of(halo_); ++r) spans[r].solid = active[r] == spans[r].end - spans[r].begin;
}

void TileGather::scatter(const float* plane, float* bricks) const {
    const int in_leaf = (x_ & (dim - 1)) * dim * dim;
    for_leaves([&](std::int32_t brick, const Part& y, const Part& z) {
        if (brick == BlockLayout::none || !y.own || !z.own) return;
        // Whole leaves, also where not all of their rows were gathered.
        kernels_.collect(plane + (y.at - y.from) * stride_ + z.at, stride_,
                         bricks + static_cast<std::size_t>(brick) * BlockField::brick_size + in_leaf);
    });
}

}  // namespace vdbgeo::stencil
