#include "vdbgeo/volume/grid_builder.h"

#include <emmintrin.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using leaf::Leaf;
using openvdb::Coord;

/// Count, mean and squared deviations of a set of samples; sets join by Chan's update.
struct Moments {
    std::uint64_t count = 0, non_finite = 0;
    double mean = 0, squares = 0;
    float min = std::numeric_limits<float>::infinity(), max = -std::numeric_limits<float>::infinity();

    void join(const Moments& other) {
        non_finite += other.non_finite;
        if (other.count == 0) return;
        const double n = static_cast<double>(count), m = static_cast<double>(other.count);
        const double shift = other.mean - mean;
        mean += shift * m / (n + m);
        squares += other.squares + shift * shift * n * m / (n + m);
        count += other.count;
        min = std::min(min, other.min);
        max = std::max(max, other.max);
    }
};

/// Samples handed to the builder for one leaf: a box of 1…8 voxels an edge in leaf order.
struct Block {
    alignas(64) float values[leaf::size];
    Vec3i extent;  // voxels inside the map along x, y, z
    bool whole() const { return extent == Vec3i(leaf::dim, leaf::dim, leaf::dim); }
};

template <class Visit>
void for_each_inside(const Vec3i& extent, const Visit& visit) {
    for (int x = 0; x < extent.x(); ++x)
        for (int y = 0; y < extent.y(); ++y)
            for (int z = 0; z < extent.z(); ++z) visit(leaf::offset(x, y, z));
}

/// Any block, any values: the plain way.
Moments moments_of(const Block& block) {
    Moments m;
    double sum = 0;
    for_each_inside(block.extent, [&](int i) {
        const float v = block.values[i];
        if (!std::isfinite(v)) {
            ++m.non_finite;
            return;
        }
        ++m.count;
        sum += v;
        m.min = std::min(m.min, v);
        m.max = std::max(m.max, v);
    });
    if (m.count == 0) return m;
    m.mean = sum / static_cast<double>(m.count);
    for_each_inside(block.extent, [&](int i) {
        const double d = block.values[i] - m.mean;
        if (std::isfinite(d)) m.squares += d * d;
    });
    return m;
}

/// A whole block in one pass, relative to its first value so that nothing cancels. Returns false when a
/// sample is not finite.
bool quick_moments_of(const float* values, Moments& m) {
    const float first = values[0];
    const __m128d shift = _mm_set1_pd(first);
    __m128 low = _mm_set1_ps(first), high = low;
    __m128d sum0 = _mm_setzero_pd(), sum1 = sum0, squares0 = sum0, squares1 = sum0;
    for (int i = 0; i < leaf::size; i += 4) {
        const __m128 v = _mm_load_ps(values + i);
        low = _mm_min_ps(low, v);
        high = _mm_max_ps(high, v);
        const __m128d a = _mm_sub_pd(_mm_cvtps_pd(v), shift);
        const __m128d b = _mm_sub_pd(_mm_cvtps_pd(_mm_movehl_ps(v, v)), shift);
        sum0 = _mm_add_pd(sum0, a);
        sum1 = _mm_add_pd(sum1, b);
        squares0 = _mm_add_pd(squares0, _mm_mul_pd(a, a));
        squares1 = _mm_add_pd(squares1, _mm_mul_pd(b, b));
    }
    alignas(16) double s[2], q[2];
    alignas(16) float l[4], h[4];
    _mm_store_pd(s, _mm_add_pd(sum0, sum1));
    _mm_store_pd(q, _mm_add_pd(squares0, squares1));
    _mm_store_ps(l, low);
    _mm_store_ps(h, high);
    const double total = s[0] + s[1], square = q[0] + q[1];
    if (!std::isfinite(square)) return false;
    m.count = leaf::size;
    m.mean = first + total / leaf::size;
    m.squares = std::max(0.0, square - total * total / leaf::size);
    m.min = *std::min_element(l, l + 4);
    m.max = *std::max_element(h, h + 4);
    return true;
}

/// 8 × 8 floats with row strides → transposed.
void transpose_8x8(const float* in, std::size_t in_stride, float* out, std::size_t out_stride) {
    for (int i = 0; i < 8; i += 4)
        for (int j = 0; j < 8; j += 4) {
            const float* p = in + static_cast<std::size_t>(i) * in_stride + j;
            __m128 a = _mm_loadu_ps(p), b = _mm_loadu_ps(p + in_stride), c = _mm_loadu_ps(p + 2 * in_stride),
                   d = _mm_loadu_ps(p + 3 * in_stride);
            _MM_TRANSPOSE4_PS(a, b, c, d);
            float* q = out + static_cast<std::size_t>(j) * out_stride + i;
            _mm_store_ps(q, a);
            _mm_store_ps(q + out_stride, b);
            _mm_store_ps(q + 2 * out_stride, c);
            _mm_store_ps(q + 3 * out_stride, d);
        }
}

bool all_same_bits(const float* values) {
    return std::memcmp(values, values + 1, (leaf::size - 1) * sizeof(float)) == 0;
}

}  // namespace

void SparsifyOptions::check() const {
    if (threshold && !std::isfinite(*threshold)) throw InvalidInput("the threshold is not a finite number");
    if (background && !std::isfinite(*background))
        throw InvalidInput("the background is not a finite number");
    if (band && !threshold) throw InvalidInput("a band needs an isovalue (the threshold) to lie about");
    if (band && !(*band > 0 && std::isfinite(*band))) throw InvalidInput("the band's width is not positive");
    if (band && (*threshold + *band == *threshold || *threshold - *band == *threshold))
        throw InvalidInput(
            fmt::format("the band's width {} is lost in rounding beside the isovalue {}", *band, *threshold));
    if (threshold && background && *background > *threshold)
        throw InvalidInput(
            fmt::format("the background {} lies above the threshold {}: what is dropped would "
                        "read as if it were kept",
                        *background, *threshold));
}

struct GridBuilder::State {
    /// What one block of the map becomes: nothing, a tile of one value, or a leaf.
    struct Result {
        Moments moments;
        std::unique_ptr<Leaf> leaf;
        enum class Tile { none, kept, above } tile = Tile::none;
        float tile_value = 0;
        Coord origin;
    };

    Vec3i size;
    std::array<int, 3> order;
    SparsifyOptions options;
    std::array<std::size_t, 3> stride{};  // of x, y, z in the data, in floats
    int done = 0;                         // sections so far
    Moments moments;
    // Until finish() knows the background, what was dropped reads as -infinity.
    openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(-std::numeric_limits<float>::infinity());
    std::vector<Leaf*> leaves;  // owned by the grid's tree
    std::vector<float> border;
    std::uint64_t border_seen = 0, border_step = 1;

    float upper() const { return *options.threshold + *options.band; }
    float lower() const { return options.band ? *options.threshold - *options.band : *options.threshold; }

    void sample_border(const float* data, int count);
    void take_block(const float* data, int first, int count, int i, int j, Result& result) const;
    void load(const float* data, int first, const Coord& origin, Block& block) const;
    void decide(const Block& block, Result& result) const;
    float solvent_level();
};

GridBuilder::GridBuilder(const Vec3i& size, const std::array<int, 3>& order, const SparsifyOptions& options)
    : state_(std::make_unique<State>()) {
    options.check();
    if (size.minCoeff() < 1) throw InvalidInput("a map needs at least one sample along each axis");
    std::array<int, 3> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    if (sorted != std::array<int, 3>{0, 1, 2})
        throw InvalidInput("the axis order is not a permutation of x, y, z");
    State& s = *state_;
    s.size = size;
    s.order = order;
    s.options = options;
    s.stride[static_cast<std::size_t>(order[0])] = 1;
    s.stride[static_cast<std::size_t>(order[1])] = static_cast<std::size_t>(size[order[0]]);
    s.stride[static_cast<std::size_t>(order[2])] =
        static_cast<std::size_t>(size[order[0]]) * static_cast<std::size_t>(size[order[1]]);
    const double nx = size.x(), ny = size.y(), nz = size.z();
    // Odd: inner rows give one sample of either face in turn, and an even step would miss one face.
    s.border_step = static_cast<std::uint64_t>(2 * (nx * ny + ny * nz + nz * nx) / (1 << 20)) | 1;
}

GridBuilder::~GridBuilder() = default;

/// Collects every border_step-th sample on the faces of the box, in file order.
void GridBuilder::State::sample_border(const float* data, int count) {
    const int columns = size[order[0]], rows = size[order[1]], sections = size[order[2]];
    const auto take = [&](float v) {
        if (border_seen++ % border_step == 0 && std::isfinite(v)) border.push_back(v);
    };
    for (int s = 0; s < count; ++s) {
        const float* section =
            data + static_cast<std::size_t>(s) * stride[static_cast<std::size_t>(order[2])];
        const bool outer = done + s == 0 || done + s == sections - 1;
        for (int r = 0; r < rows; ++r) {
            const float* row = section + static_cast<std::size_t>(r) * static_cast<std::size_t>(columns);
            if (outer || r == 0 || r == rows - 1) {
                for (int c = 0; c < columns; ++c) take(row[c]);
            } else {
                take(row[0]);
                if (columns > 1) take(row[columns - 1]);
            }
        }
    }
}

/// Copies the samples of one leaf, from data whose first section is `first`, into leaf order.
void GridBuilder::State::load(const float* data, int first, const Coord& origin, Block& block) const {
    const std::size_t sx = stride[0], sy = stride[1], sz = stride[2];
    Vec3i start(origin.x(), origin.y(), origin.z());
    start[order[2]] -= first;
    const float* base = data + static_cast<std::size_t>(start.x()) * sx +
                        static_cast<std::size_t>(start.y()) * sy + static_cast<std::size_t>(start.z()) * sz;
    if (block.whole() && sx == 1) {  // x runs fastest: 8 × 8 transposes
        for (std::size_t y = 0; y < 8; ++y)
            transpose_8x8(base + y * sy, sz, block.values + leaf::offset(0, static_cast<int>(y), 0),
                          leaf::rows);
    } else if (block.whole() && sy == 1) {
        for (std::size_t x = 0; x < 8; ++x)
            transpose_8x8(base + x * sx, sz, block.values + leaf::offset(static_cast<int>(x), 0, 0),
                          leaf::dim);
    } else {
        for (int x = 0; x < block.extent.x(); ++x)
            for (int y = 0; y < block.extent.y(); ++y)
                for (int z = 0; z < block.extent.z(); ++z)
                    block.values[leaf::offset(x, y, z)] =
                        base[static_cast<std::size_t>(x) * sx + static_cast<std::size_t>(y) * sy +
                             static_cast<std::size_t>(z) * sz];
    }
}

/// Keeps, drops or turns into a tile what a block holds.
void GridBuilder::State::decide(const Block& block, Result& result) const {
    const bool keep_all = !options.threshold;
    const float low = keep_all ? 0 : lower();
    const float high = options.band ? upper() : std::numeric_limits<float>::infinity();
    const Moments& m = result.moments;
    if (!keep_all && (m.count == 0 || m.max <= low)) return;
    if (!keep_all && block.whole() && m.non_finite == 0 && m.min > high) {
        result.tile = Result::Tile::above;
        result.tile_value = high;
        return;
    }
    if (block.whole() && all_same_bits(block.values) &&
        (keep_all || (block.values[0] > low && block.values[0] <= high))) {
        result.tile = Result::Tile::kept;
        result.tile_value = block.values[0];
        return;
    }
    auto made = std::make_unique<Leaf>(result.origin, -std::numeric_limits<float>::infinity(), false);
    float* out = made->buffer().data();
    auto& mask = made->getValueMask();
    if (keep_all && block.whole()) {
        std::memcpy(out, block.values, sizeof block.values);
        mask.setOn();
    } else {
        for_each_inside(block.extent, [&](int i) {
            const float v = block.values[i];
            out[i] = v > high && std::isfinite(v) ? high : v;
            if (keep_all || (v > low && v <= high && std::isfinite(v)))
                mask.setOn(static_cast<openvdb::Index32>(i));
        });
        // What lies above a band stays there, as an inactive value; what lies below becomes background.
        if (mask.isOff() && !(m.max > high)) return;
    }
    result.leaf = std::move(made);
}

void GridBuilder::State::take_block(const float* data, int first, int count, int i, int j,
                                    Result& result) const {
    Vec3i origin = Vec3i::Zero(), extent;
    origin[order[0]] = i * leaf::dim;
    origin[order[1]] = j * leaf::dim;
    origin[order[2]] = first;
    for (int a = 0; a < 3; ++a) extent[a] = std::min(leaf::dim, size[a] - origin[a]);
    extent[order[2]] = std::min(extent[order[2]], count);
    result.origin = Coord(origin.x(), origin.y(), origin.z());
    Block block;
    block.extent = extent;
    load(data, first, result.origin, block);
    if (!block.whole() || !quick_moments_of(block.values, result.moments)) result.moments = moments_of(block);
    decide(block, result);
}

void GridBuilder::add_sections(const float* data, int count) {
    State& s = *state_;
    const int sections = s.size[s.order[2]];
    if (count < 1 || s.done % slab != 0 || count > sections - s.done)
        throw InvalidInput(fmt::format("{} sections handed over after {} of {}", count, s.done, sections));
    s.sample_border(data, count);
    const int across = (s.size[s.order[0]] - 1) / 8 + 1, down = (s.size[s.order[1]] - 1) / 8 + 1;
    const std::size_t blocks = static_cast<std::size_t>(across) * static_cast<std::size_t>(down);
    for (int first = 0; first < count; first += slab) {
        const int height = std::min(slab, count - first);
        const float* slab_data =
            data + static_cast<std::size_t>(first) * s.stride[static_cast<std::size_t>(s.order[2])];
        std::vector<State::Result> results(blocks);
        parallel_for(blocks, 16, [&](std::size_t b) {
            const int i = static_cast<int>(b % static_cast<std::size_t>(across));
            const int j = static_cast<int>(b / static_cast<std::size_t>(across));
            s.take_block(slab_data, s.done, height, i, j, results[b]);
        });
        for (State::Result& r : results) {
            s.moments.join(r.moments);
            if (r.leaf) {
                s.leaves.push_back(r.leaf.get());
                s.grid->tree().addLeaf(r.leaf.release());
            } else if (r.tile != State::Result::Tile::none) {
                s.grid->tree().addTile(1, r.origin, r.tile_value, r.tile == State::Result::Tile::kept);
            }
        }
        s.done += height;
    }
}

float GridBuilder::State::solvent_level() {
    float level = 0;
    if (options.background) {
        level = *options.background;
    } else if (!border.empty()) {
        const auto middle = border.begin() + static_cast<std::ptrdiff_t>(border.size() / 2);
        std::nth_element(border.begin(), middle, border.end());
        level = *middle;
    }
    if (options.threshold && !options.background) level = std::min(level, lower());
    return level;
}

DensityMap GridBuilder::finish(const Frame& frame) {
    State& s = *state_;
    if (!s.grid) throw InvalidInput("the map was handed out already");
    if (s.done != s.size[s.order[2]])
        throw InvalidInput(fmt::format("{} of {} sections were handed over", s.done, s.size[s.order[2]]));
    const float background = s.solvent_level();
    const bool band = s.options.band.has_value();
    const float high = band ? s.upper() : 0;
    s.grid->tree().root().setBackground(background, false);
    parallel_for(s.leaves.size(), 64, [&](std::size_t n) {
        Leaf& leaf = *s.leaves[n];
        if (leaf.isDense()) return;
        float* values = leaf.buffer().data();
        for (auto it = leaf.beginValueOff(); it; ++it)
            if (!band || values[it.pos()] != high) values[it.pos()] = background;
    });
    // Where no leaf was made, internal nodes still hold the background that they were created with.
    std::vector<leaf::LowerNode*> lower_nodes;
    s.grid->tree().getNodes(lower_nodes);
    parallel_for(lower_nodes.size(), 1, [&](std::size_t n) {
        for (auto it = lower_nodes[n]->beginValueAll(); it; ++it)  // beginValueOff would visit children too
            if (!it.isValueOn() && (!band || *it != high)) it.setValue(background);
    });
    std::vector<leaf::UpperNode*> upper_nodes;
    s.grid->tree().getNodes(upper_nodes);
    for (auto* node : upper_nodes)
        for (auto it = node->beginValueAll(); it; ++it) it.setValue(background);

    DensityMap map;
    map.grid = std::move(s.grid);
    map.grid->setName("density");
    map.grid->setGridClass(openvdb::GRID_UNKNOWN);
    map.frame = frame;
    map.frame.size = s.size;
    Statistics& out = map.statistics;
    out.count = s.moments.count + s.moments.non_finite;
    out.non_finite = s.moments.non_finite;
    out.min = s.moments.min;
    out.max = s.moments.max;
    out.mean = s.moments.mean;
    out.rms = s.moments.count ? std::sqrt(s.moments.squares / static_cast<double>(s.moments.count)) : 0;
    store_frame(map);
    return map;
}

}  // namespace vdbgeo
