#include "vdbgeo/volume/sparsify.h"

#include <emmintrin.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using leaf::Leaf;
using openvdb::Coord;

float value_of(const Strip& strip, std::int16_t integer) {
    return static_cast<float>(strip.sign * (integer + strip.bias));
}

/// Samples of one block inside a strip: `width` columns from `column` on.
struct Window {
    const Strip& strip;
    int column, width;

    bool whole() const {
        return width == leaf::dim && strip.rows == leaf::dim && strip.sections == leaf::dim;
    }
    std::size_t at(int section, int row) const {
        return static_cast<std::size_t>(section) * strip.section_stride +
               static_cast<std::size_t>(row) * strip.row_stride + static_cast<std::size_t>(column);
    }
};

/// Any block, any values: the plain way.
Moments moments_of_floats(const Window& w) {
    Moments m;
    double sum = 0;
    const auto each = [&](const auto& body) {
        for (int s = 0; s < w.strip.sections; ++s)
            for (int r = 0; r < w.strip.rows; ++r)
                for (int c = 0; c < w.width; ++c)
                    body(w.strip.floats[w.at(s, r) + static_cast<std::size_t>(c)]);
    };
    each([&](float v) {
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
    each([&](float v) {
        const double d = v - m.mean;
        if (std::isfinite(d)) m.squares += d * d;
    });
    return m;
}

/// A whole block in one pass, relative to its first value so that nothing cancels. Returns false when a
/// sample is not finite.
bool quick_moments_of_floats(const Window& w, Moments& m) {
    const float first = w.strip.floats[w.at(0, 0)];
    const __m128d shift = _mm_set1_pd(first);
    __m128 low = _mm_set1_ps(first), high = low;
    __m128d sum0 = _mm_setzero_pd(), sum1 = sum0, squares0 = sum0, squares1 = sum0;
    const auto add = [&](__m128 v) {
        low = _mm_min_ps(low, v);
        high = _mm_max_ps(high, v);
        const __m128d a = _mm_sub_pd(_mm_cvtps_pd(v), shift);
        const __m128d b = _mm_sub_pd(_mm_cvtps_pd(_mm_movehl_ps(v, v)), shift);
        sum0 = _mm_add_pd(sum0, a);
        sum1 = _mm_add_pd(sum1, b);
        squares0 = _mm_add_pd(squares0, _mm_mul_pd(a, a));
        squares1 = _mm_add_pd(squares1, _mm_mul_pd(b, b));
    };
    for (int s = 0; s < leaf::dim; ++s)
        for (int r = 0; r < leaf::dim; ++r) {
            const float* p = w.strip.floats + w.at(s, r);
            add(_mm_loadu_ps(p));
            add(_mm_loadu_ps(p + 4));
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

/// Sums over integers: exact, so that the order of the additions is all one.
struct IntegerSums {
    std::int64_t count = 0, sum = 0;
    std::uint64_t squares = 0;
    int min = std::numeric_limits<std::int16_t>::max(), max = std::numeric_limits<std::int16_t>::min();

    void add(const IntegerSums& other) {
        count += other.count;
        sum += other.sum;
        squares += other.squares;
        min = std::min(min, other.min);
        max = std::max(max, other.max);
    }
    /// Of the values that the strip's integers stand for.
    Moments moments(const Strip& strip) const {
        Moments m;
        m.count = static_cast<std::uint64_t>(count);
        if (count == 0) return m;
        const double n = static_cast<double>(count);
        __extension__ using Wide = __int128;
        const Wide spread =
            static_cast<Wide>(count) * static_cast<Wide>(squares) - static_cast<Wide>(sum) * sum;
        m.squares = static_cast<double>(spread) / n;
        m.mean = strip.sign * (static_cast<double>(sum) / n + strip.bias);
        const float a = value_of(strip, static_cast<std::int16_t>(min)),
                    b = value_of(strip, static_cast<std::int16_t>(max));
        m.min = std::min(a, b);
        m.max = std::max(a, b);
        return m;
    }
};

IntegerSums plain_sums(const Window& w) {
    IntegerSums sums;
    for (int s = 0; s < w.strip.sections; ++s)
        for (int r = 0; r < w.strip.rows; ++r) {
            const std::int16_t* p = w.strip.integers + w.at(s, r);
            for (int c = 0; c < w.width; ++c) {
                const int v = p[c];
                sums.sum += v;
                sums.squares += static_cast<std::uint64_t>(v * std::int64_t(v));
                sums.min = std::min(sums.min, v);
                sums.max = std::max(sums.max, v);
            }
        }
    sums.count = std::int64_t(w.width) * w.strip.rows * w.strip.sections;
    return sums;
}

/// A whole block, eight integers at a time.
IntegerSums quick_sums(const Window& w) {
    const __m128i ones = _mm_set1_epi16(1), zero = _mm_setzero_si128();
    __m128i low = _mm_set1_epi16(std::numeric_limits<std::int16_t>::max()),
            high = _mm_set1_epi16(std::numeric_limits<std::int16_t>::min());
    __m128i sum = zero, squares0 = zero, squares1 = zero;
    for (int s = 0; s < leaf::dim; ++s)
        for (int r = 0; r < leaf::dim; ++r) {
            const __m128i v =
                _mm_loadu_si128(reinterpret_cast<const __m128i*>(w.strip.integers + w.at(s, r)));
            low = _mm_min_epi16(low, v);
            high = _mm_max_epi16(high, v);
            sum = _mm_add_epi32(sum, _mm_madd_epi16(v, ones));
            const __m128i square = _mm_madd_epi16(v, v);  // two squares: at most 2^31, without a sign
            squares0 = _mm_add_epi64(squares0, _mm_unpacklo_epi32(square, zero));
            squares1 = _mm_add_epi64(squares1, _mm_unpackhi_epi32(square, zero));
        }
    alignas(16) std::int16_t l[8], h[8];
    alignas(16) std::int32_t s[4];
    alignas(16) std::uint64_t q[2];
    _mm_store_si128(reinterpret_cast<__m128i*>(l), low);
    _mm_store_si128(reinterpret_cast<__m128i*>(h), high);
    _mm_store_si128(reinterpret_cast<__m128i*>(s), sum);
    _mm_store_si128(reinterpret_cast<__m128i*>(q), _mm_add_epi64(squares0, squares1));
    IntegerSums sums;
    sums.count = leaf::size;
    sums.sum = std::int64_t(s[0]) + s[1] + s[2] + s[3];
    sums.squares = q[0] + q[1];
    sums.min = *std::min_element(l, l + 8);
    sums.max = *std::max_element(h, h + 8);
    return sums;
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

constexpr std::array<std::size_t, 3> leaf_step{64, 8,
                                               1};  // in a leaf, from one sample to the next along x, y, z

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
    if (quantisation && quantisation_step(*quantisation) != *quantisation)
        throw InvalidInput(fmt::format("the quantisation {} is not a power of two", *quantisation));
    if (threshold && background && *background > *threshold)
        throw InvalidInput(
            fmt::format("the background {} lies above the threshold {}: what is dropped would "
                        "read as if it were kept",
                        *background, *threshold));
}

void Strip::copy_row(int section, int row, float* out) const {
    const std::size_t at = static_cast<std::size_t>(section) * section_stride +
                           static_cast<std::size_t>(row) * row_stride,
                      n = static_cast<std::size_t>(columns);
    if (floats) {
        std::memcpy(out, floats + at, n * sizeof(float));
        return;
    }
    for (std::size_t i = 0; i < n; ++i) out[i] = value_of(*this, integers[at + i]);
}

void Moments::join(const Moments& other) {
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

Statistics Moments::statistics() const {
    Statistics s;
    s.count = count + non_finite;
    s.non_finite = non_finite;
    s.min = min;
    s.max = max;
    s.mean = mean;
    s.rms = count ? std::sqrt(squares / static_cast<double>(count)) : 0;
    return s;
}

/// The samples of one block in leaf order: a box of 1…8 voxels an edge.
struct StripSorter::Block {
    alignas(64) float values[leaf::size];
    Vec3i extent;  // voxels inside the map along x, y, z

    bool whole() const { return extent == Vec3i(leaf::dim, leaf::dim, leaf::dim); }
    template <class Visit>
    void for_each_inside(const Visit& visit) const {
        for (int x = 0; x < extent.x(); ++x)
            for (int y = 0; y < extent.y(); ++y)
                for (int z = 0; z < extent.z(); ++z) visit(leaf::offset(x, y, z));
    }
};

StripSorter::StripSorter(const Vec3i& size, const std::array<int, 3>& order, const SparsifyOptions& options,
                         const openvdb::MaskTree* keep)
    : size_(size), order_(order), options_(options), keep_(keep) {
    options.check();
    if (size.minCoeff() < 1) throw InvalidInput("a map needs at least one sample along each axis");
    std::array<int, 3> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    if (sorted != std::array<int, 3>{0, 1, 2})
        throw InvalidInput("the axis order is not a permutation of x, y, z");
    const double nx = size.x(), ny = size.y(), nz = size.z();
    // Odd: inner rows give one sample of either face in turn, and an even step would miss one face.
    border_step_ = static_cast<std::uint64_t>(2 * (nx * ny + ny * nz + nz * nx) / (1 << 20)) | 1;
}

float StripSorter::upper_end() const {
    return options_.band ? *options_.threshold + *options_.band : std::numeric_limits<float>::infinity();
}

float StripSorter::lower_end() const {
    if (!options_.threshold) return -std::numeric_limits<float>::infinity();
    return options_.band ? *options_.threshold - *options_.band : *options_.threshold;
}

/// Takes every border_step_-th sample on the faces of the box, counted in file order.
void StripSorter::sample_border(const Strip& strip, int slab, int row, std::vector<float>& out) const {
    const std::uint64_t columns = static_cast<std::uint64_t>(size_[order_[0]]),
                        rows = static_cast<std::uint64_t>(size_[order_[1]]),
                        sections = static_cast<std::uint64_t>(size_[order_[2]]);
    const std::uint64_t side = columns > 1 ? 2 : 1;  // of an inner row
    const std::uint64_t outer_section = columns * rows;
    const std::uint64_t inner_section = rows > 1 ? 2 * columns + side * (rows - 2) : columns;
    const auto take = [&](std::uint64_t number, int s, int r, std::uint64_t c) {
        if (number % border_step_ != 0) return;
        const std::size_t at = static_cast<std::size_t>(s) * strip.section_stride +
                               static_cast<std::size_t>(r) * strip.row_stride + c;
        const float v = strip.integers ? value_of(strip, strip.integers[at]) : strip.floats[at];
        if (std::isfinite(v)) out.push_back(v);
    };
    for (int s = 0; s < strip.sections; ++s) {
        const std::uint64_t section =
            static_cast<std::uint64_t>(slab) * leaf::dim + static_cast<std::uint64_t>(s);
        const bool outer = section == 0 || section == sections - 1;
        const std::uint64_t before =
            section == 0 ? 0 : outer_section + (section - 1) * inner_section;  // in the sections before
        for (int r = 0; r < strip.rows; ++r) {
            const std::uint64_t line =
                static_cast<std::uint64_t>(row) * leaf::dim + static_cast<std::uint64_t>(r);
            if (outer || line == 0 || line == rows - 1) {
                const std::uint64_t start = before + (outer       ? line * columns
                                                      : line == 0 ? 0
                                                                  : columns + side * (rows - 2));
                for (std::uint64_t c = (border_step_ - start % border_step_) % border_step_; c < columns;
                     c += border_step_)
                    take(start + c, s, r, c);
            } else {
                const std::uint64_t start = before + columns + side * (line - 1);
                take(start, s, r, 0);
                if (columns > 1) take(start + 1, s, r, columns - 1);
            }
        }
    }
}

/// Copies the samples of one block into leaf order.
void StripSorter::load(const Strip& strip, int column, Block& block) const {
    alignas(64) float tile[leaf::size];  // [section][row][column]
    const Window w{strip, column, block.extent[order_[0]]};
    for (int s = 0; s < strip.sections; ++s)
        for (int r = 0; r < strip.rows; ++r) {
            float* to = tile + 64 * s + 8 * r;
            if (strip.integers) {
                const std::int16_t* from = strip.integers + w.at(s, r);
                for (int c = 0; c < w.width; ++c) to[c] = value_of(strip, from[c]);
            } else {
                std::memcpy(to, strip.floats + w.at(s, r), static_cast<std::size_t>(w.width) * sizeof(float));
            }
        }
    const auto step = [&](int k) {
        return leaf_step[static_cast<std::size_t>(order_[static_cast<std::size_t>(k)])];
    };
    if (!block.whole()) {
        for (int s = 0; s < strip.sections; ++s)
            for (int r = 0; r < strip.rows; ++r)
                for (int c = 0; c < w.width; ++c)
                    block.values[static_cast<std::size_t>(c) * step(0) +
                                 static_cast<std::size_t>(r) * step(1) +
                                 static_cast<std::size_t>(s) * step(2)] = tile[64 * s + 8 * r + c];
        return;
    }
    // z is what runs fastest in a leaf: the plane of columns and z is transposed for each step of the third
    // axis.
    const int z = order_[0] == 2 ? 0 : order_[1] == 2 ? 1 : 2, third = z == 1 ? 2 : 1;
    for (std::size_t i = 0; i < 8; ++i) {
        const float* in = tile + (third == 1 ? 8 : 64) * i;
        float* out = block.values + step(third) * i;
        if (z == 0)
            for (std::size_t j = 0; j < 8; ++j)
                std::memcpy(out + step(2) * j, in + 64 * j, 8 * sizeof(float));
        else
            transpose_8x8(in, z == 1 ? 8 : 64, out, step(0));
    }
}

bool StripSorter::nothing_stays(const Moments& m, const Coord& origin) const {
    if (keep_) return !keep_->probeConstLeaf(origin) && !keep_->isValueOn(origin);
    return options_.threshold && (m.count == 0 || m.max <= lower_end());
}

/// mark_kept for a whole block and a threshold alone, eight samples at a time.
bool StripSorter::mark_above(const Block& block, leaf::Leaf& leaf) const {
    const __m128 low = _mm_set1_ps(lower_end()), highest = _mm_set1_ps(std::numeric_limits<float>::max()),
                 background = _mm_set1_ps(unknown_background);
    float* out = leaf.buffer().data();
    const auto four = [&](int i) {  // NaN compares false with both
        const __m128 v = _mm_load_ps(block.values + i);
        const __m128 kept = _mm_and_ps(_mm_cmpgt_ps(v, low), _mm_cmple_ps(v, highest));
        _mm_storeu_ps(out + i, _mm_or_ps(_mm_and_ps(kept, v), _mm_andnot_ps(kept, background)));
        return static_cast<std::uint64_t>(_mm_movemask_ps(kept));
    };
    std::uint64_t any = 0;
    for (int x = 0; x < leaf::dim; ++x) {
        std::uint64_t word = 0;
        for (int y = 0; y < leaf::dim; ++y) {
            const int row = leaf::offset(x, y, 0);
            word |= (four(row) | four(row + 4) << 4) << 8 * y;
        }
        leaf.getValueMask().getWord<std::uint64_t>(static_cast<openvdb::Index>(x)) = word;
        any |= word;
    }
    return any != 0;
}

/// Marks what is kept of a block as active in result.leaf, and gives it its values; true where there is any.
bool StripSorter::mark_kept(const Block& block, SortedBlock& result) const {
    if (!keep_ && options_.threshold && !options_.band && block.whole())
        return mark_above(block, *result.leaf);
    const float low = lower_end(), high = upper_end();
    const bool keep_all = !keep_ && !options_.threshold;
    const auto* chosen = keep_ ? keep_->probeConstLeaf(result.origin) : nullptr;
    float* out = result.leaf->buffer().data();
    auto& mask = result.leaf->getValueMask();
    bool any = false;
    block.for_each_inside([&](int i) {
        const float v = block.values[i];
        const auto n = static_cast<openvdb::Index32>(i);
        const bool kept = keep_all || (std::isfinite(v) &&
                                       (keep_ ? !chosen || chosen->isValueOn(n) : v > low && v <= high));
        if (kept) {
            out[i] = v;
            mask.setOn(n);
            any = true;
        } else if (!keep_ && v > high && std::isfinite(v)) {
            out[i] = high;  // what lies above a band stays there, as an inactive value
            any = true;
        }
    });
    return any;
}

/// Keeps, drops or turns into a tile what a block holds.
void StripSorter::decide(const Block& block, const Moments& m, SortedBlock& result) const {
    const bool keep_all = !keep_ && !options_.threshold;
    const float low = lower_end(), high = upper_end();
    if (!keep_ && block.whole() && m.non_finite == 0 && m.min > high) {
        result.tile = SortedBlock::Tile::above;
        result.tile_value = high;
        return;
    }
    const float first = block.values[0];
    if (block.whole() && all_same_bits(block.values) &&
        (keep_ ? std::isfinite(first) && !keep_->probeConstLeaf(result.origin)
               : keep_all || (first > low && first <= high))) {
        result.tile = SortedBlock::Tile::kept;
        result.tile_value = first;
        return;
    }
    result.leaf = std::make_unique<Leaf>(result.origin, unknown_background, false);
    if (keep_all && block.whole()) {
        std::memcpy(result.leaf->buffer().data(), block.values, sizeof block.values);
        result.leaf->getValueMask().setOn();
    } else if (!mark_kept(block, result)) {
        result.leaf.reset();
    }
}

RoundingError StripSorter::round(SortedBlock& block) const {
    if (block.leaf) return quantise(*block.leaf, *options_.quantisation);
    RoundingError error;
    if (block.tile != SortedBlock::Tile::kept || !std::isfinite(block.tile_value)) return error;
    const float rounded = quantise(block.tile_value, *options_.quantisation);
    error.largest = std::abs(double(rounded) - block.tile_value);
    if (block.tile_value != 0) error.largest_relative = error.largest / std::abs(double(block.tile_value));
    error.at = block.origin;
    error.value = block.tile_value;
    block.tile_value = rounded;
    return error;
}

SortedStrip StripSorter::sort(const Strip& strip, int slab, int row) const {
    SortedStrip result;
    IntegerSums all;
    Vec3i origin = Vec3i::Zero();
    origin[order_[1]] = row * leaf::dim;
    origin[order_[2]] = slab * leaf::dim;
    for (int column = 0; column < strip.columns; column += leaf::dim) {
        const Window w{strip, column, std::min(leaf::dim, strip.columns - column)};
        Moments m;
        if (strip.integers) {
            const IntegerSums sums = w.whole() ? quick_sums(w) : plain_sums(w);
            all.add(sums);
            m.count = static_cast<std::uint64_t>(sums.count);
            const float a = value_of(strip, static_cast<std::int16_t>(sums.min)),
                        b = value_of(strip, static_cast<std::int16_t>(sums.max));
            m.min = std::min(a, b);
            m.max = std::max(a, b);
        } else {
            if (!w.whole() || !quick_moments_of_floats(w, m)) m = moments_of_floats(w);
            result.moments.join(m);
        }
        origin[order_[0]] = column;
        SortedBlock block;
        block.origin = Coord(origin.x(), origin.y(), origin.z());
        if (nothing_stays(m, block.origin)) continue;
        Block samples;
        samples.extent[order_[0]] = w.width;
        samples.extent[order_[1]] = strip.rows;
        samples.extent[order_[2]] = strip.sections;
        load(strip, column, samples);
        decide(samples, m, block);
        if (options_.quantisation) result.rounding.join(round(block));
        if (block.leaf || block.tile != SortedBlock::Tile::none) result.blocks.push_back(std::move(block));
    }
    if (strip.integers) result.moments = all.moments(strip);
    sample_border(strip, slab, row, result.border);
    return result;
}

void MapTotals::add(const SortedStrip& strip) {
    moments_.join(strip.moments);
    border_.insert(border_.end(), strip.border.begin(), strip.border.end());
    rounding_.join(strip.rounding);
}

float MapTotals::background(const StripSorter& sorter) {
    const SparsifyOptions& options = sorter.options();
    if (options.background) return *options.background;
    float level = 0;
    if (!border_.empty()) {
        const auto middle = border_.begin() + static_cast<std::ptrdiff_t>(border_.size() / 2);
        std::nth_element(border_.begin(), middle, border_.end());
        level = *middle;
    }
    return options.threshold ? std::min(level, sorter.lower_end()) : level;
}

}  // namespace vdbgeo
