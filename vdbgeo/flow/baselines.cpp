#include "vdbgeo/flow/baselines.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/stencil/block_field.h"
#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/stencil/plane_kernels.h"
#include "vdbgeo/stencil/tiles.h"

namespace vdbgeo {
namespace {

using stencil::BlockField;
using stencil::BlockLayout;
using stencil::lanes;
using stencil::RowSpan;
using stencil::Tile;

constexpr double widest = 10.5;  // voxels: what a tile's halo holds three times
constexpr int size_x = BlockLayout::size_x, size_y = BlockLayout::size_y, size_z = BlockLayout::size_z;

void check_width(double sigma) {
    if (!(sigma >= 0 && sigma <= widest))
        throw InvalidInput(
            fmt::format("the standard deviation in space is {:g} voxels: 0 to {}", sigma, widest));
}

/// Replaces the active values by what `body` makes of them, tile by tile. `centred`: the tiles hold them
/// without their mean, so that sums round less.
void filter(openvdb::FloatGrid& grid, int halo, bool centred, const std::function<void(Tile&)>& body,
            const Progress& progress) {
    if (grid.tree().hasActiveTiles()) grid.tree().voxelizeActiveTiles();
    const BlockLayout layout(grid.tree());
    BlockField in(layout.brick_count()), out(layout.brick_count());
    stencil::load(layout, grid.tree(), 0, in.brick(0));
    const stencil::FieldSummary given = summarize(layout, in.brick(0));
    if (given.non_finite)
        throw InvalidInput(fmt::format("{} of {} values are NaN or infinite", given.non_finite,
                                       given.count + given.non_finite));
    const auto offset = static_cast<float>(centred ? given.mean() : 0);
    if (centred) stencil::load(layout, grid.tree(), offset, in.brick(0));
    for_each_tile(layout, {{in.brick(0)}, {out.brick(0)}, halo, 0}, body, progress);
    stencil::store(layout, out.brick(0), offset, grid.tree());
}

/// Half of a sampled Gaussian, g[0] in the middle; Σ over both halves is 1.
std::vector<float> gaussian_taps(double sigma) {
    std::vector<double> g;
    double sum = 0;
    for (int t = 0; t <= static_cast<int>(std::ceil(3 * sigma)); ++t) {
        g.push_back(std::exp(-0.5 * (t / sigma) * (t / sigma)));
        sum += (t == 0 ? 1 : 2) * g.back();
    }
    std::vector<float> taps;
    for (const double w : g) taps.push_back(static_cast<float>(w / sum));
    return taps;
}

/// out[i] = Σ_t g_t in[i + t · step] for i in [0, n), n a multiple of `lanes`.
void convolve(const std::vector<float>& g, const float* in, std::ptrdiff_t step, std::ptrdiff_t n,
              float* __restrict out) {
    for (std::ptrdiff_t i = 0; i < n; i += lanes) {
        float sum[lanes];
        for (int k = 0; k < lanes; ++k) sum[k] = g[0] * in[i + k];
        const float *before = in + i, *after = in + i;
        for (std::size_t t = 1; t < g.size(); ++t) {
            before -= step;
            after += step;
            for (int k = 0; k < lanes; ++k) sum[k] += g[t] * (before[k] + after[k]);
        }
        for (int k = 0; k < lanes; ++k) out[i + k] = sum[k];
    }
}

/// Rows [begin, end) of one plane of a tile that have active voxels; empty where begin ≥ end.
RowSpan active_rows(const Tile& t, int x) {
    RowSpan rows{size_y, 0};
    for (int y = 0; y < size_y; ++y) {
        if (t.span(x, y).begin >= t.span(x, y).end) continue;
        rows.begin = std::min(rows.begin, static_cast<std::int16_t>(y));
        rows.end = static_cast<std::int16_t>(y + 1);
    }
    return rows;
}

bool all_active(const Tile& t) {
    float least = 1;
    for (int x = -t.halo; x < size_x + t.halo; ++x)
        for (int y = -t.halo; y < size_y + t.halo; ++y) {
            const float* row = t.active + t.at(x, y, -t.halo);
            for (int z = 0; z < size_z + 2 * t.halo; ++z) least = row[z] < least ? row[z] : least;
        }
    return least > 0;
}

/// The three passes over one array of a tile, one plane of results at a time.
class Separable {
 public:
    Separable(const Tile& t, const std::vector<float>& g)
        : tile_(t),
          g_(g),
          r_(static_cast<int>(g.size()) - 1),
          plane_(static_cast<std::size_t>((size_y + 2 * r_) * t.stride_y)),
          row_(static_cast<std::size_t>(t.stride_y)) {}

    /// Along x, for the rows of a plane and those around them.
    void take_plane(const float* array, int x, RowSpan rows) {
        for (int y = rows.begin - r_; y < rows.end + r_; ++y)
            convolve(g_, array + tile_.at(x, y, -tile_.lead), tile_.stride_x, tile_.stride_y, at(y));
    }
    /// Along y and z.
    void finish_row(int y, float* out) {
        convolve(g_, at(y), tile_.stride_y, tile_.stride_y, row_.data());
        std::array<float, size_z + 2 * BlockLayout::max_halo> line;
        std::copy_n(row_.data() + tile_.lead - r_, size_z + 2 * r_, line.data());
        convolve(g_, line.data() + r_, 1, size_z, out);
    }

 private:
    float* at(int y) { return plane_.data() + (y + r_) * tile_.stride_y; }

    const Tile& tile_;
    const std::vector<float>& g_;
    int r_;
    std::vector<float> plane_, row_;
};

void gaussian_tile(Tile& t, const std::vector<float>& g) {
    Separable sums(t, g), norms(t, g);
    const bool whole = all_active(t);
    std::array<float, size_z> norm;
    for (int x = 0; x < size_x; ++x) {
        const RowSpan rows = active_rows(t, x);
        if (rows.begin >= rows.end) continue;
        sums.take_plane(t.in[0], x, rows);
        if (!whole) norms.take_plane(t.active, x, rows);
        for (int y = rows.begin; y < rows.end; ++y) {
            float* const out = t.out[0] + t.at(x, y, 0);
            sums.finish_row(y, out);
            if (whole) continue;
            norms.finish_row(y, norm.data());
            const float* const active = t.active + t.at(x, y, 0);
            for (std::size_t z = 0; z < norm.size(); ++z) out[z] = active[z] > 0 ? out[z] / norm[z] : 0;
        }
    }
}

/// A set of ranks of which the k-th smallest is asked: a bit for each rank, and how many are in each word, in
/// eight words and in 64.
class RankSet {
 public:
    explicit RankSet(std::size_t ranks)
        : bits_(ranks / 4096 * 64 + 64),
          words_(bits_.size()),
          groups_(bits_.size() / 8),
          blocks_(bits_.size() / 64) {}

    void insert(std::uint32_t rank) { change(rank, 1); }
    void remove(std::uint32_t rank) { change(rank, -1); }
    std::size_t size() const { return size_; }

    /// The rank with k others below it; k < size().
    std::uint32_t find(std::size_t k) const {
        std::size_t at = 0;
        for (; k >= blocks_[at]; ++at) k -= blocks_[at];
        for (at *= 8; k >= groups_[at]; ++at) k -= groups_[at];
        for (at *= 8; k >= words_[at]; ++at) k -= words_[at];
        std::uint64_t word = bits_[at];
        for (; k > 0; --k) word &= word - 1;
        return static_cast<std::uint32_t>(at * 64) + static_cast<std::uint32_t>(__builtin_ctzll(word));
    }

 private:
    void change(std::uint32_t rank, int by) {
        bits_[rank / 64] ^= std::uint64_t(1) << (rank % 64);
        words_[rank / 64] = static_cast<std::uint8_t>(words_[rank / 64] + by);
        groups_[rank / 512] = static_cast<std::uint16_t>(groups_[rank / 512] + by);
        blocks_[rank / 4096] = static_cast<std::uint16_t>(blocks_[rank / 4096] + by);
        size_ += static_cast<std::size_t>(by);
    }

    std::vector<std::uint64_t> bits_;
    std::vector<std::uint8_t> words_;
    std::vector<std::uint16_t> groups_, blocks_;
    std::size_t size_ = 0;
};

/// The active voxels of a tile and its halo by rank: medians are then found among whole numbers, each there
/// once.
class Ranks {
 public:
    static constexpr std::uint32_t none = 0xffffffff;

    explicit Ranks(const Tile& t)
        : first_(t.at(-t.halo, -t.halo, -t.lead)),
          ranks_(static_cast<std::size_t>((size_x + 2 * t.halo) * t.stride_x), none) {
        std::vector<std::uint64_t> items;  // key that orders as the value does, and place
        for (int x = -t.halo; x < size_x + t.halo; ++x)
            for (int y = -t.halo; y < size_y + t.halo; ++y) {
                const RowSpan span = t.span(x, y);
                for (int z = span.begin; z < span.end; ++z)
                    if (const std::ptrdiff_t at = t.at(x, y, z); t.active[at] > 0)
                        items.push_back(key(t.in[0][at]) << 32 | static_cast<std::uint64_t>(at - first_));
            }
        sort(items);
        values_.resize(items.size());
        for (std::size_t i = 0; i < items.size(); ++i) {
            const auto place = static_cast<std::uint32_t>(items[i]);
            ranks_[place] = static_cast<std::uint32_t>(i);
            values_[i] = t.in[0][first_ + place];
        }
    }
    std::size_t size() const { return values_.size(); }
    float value(std::uint32_t rank) const { return values_[rank]; }
    const std::uint32_t* at(std::ptrdiff_t place) const { return ranks_.data() + (place - first_); }

 private:
    static std::uint64_t key(float v) {
        std::uint32_t bits;
        std::memcpy(&bits, &v, sizeof bits);
        return bits >> 31 ? ~bits : bits | 0x80000000u;
    }
    /// By the upper 32 bits, which are sorted eleven at a time from the lowest on.
    static void sort(std::vector<std::uint64_t>& items) {
        std::vector<std::uint64_t> sorted(items.size());
        for (int shift = 32; shift < 64; shift += 11) {
            std::array<std::uint32_t, 2048> start{};
            for (const std::uint64_t i : items) ++start[i >> shift & 2047];
            std::uint32_t sum = 0;
            for (std::uint32_t& s : start) sum += std::exchange(s, sum);
            for (const std::uint64_t i : items) sorted[start[i >> shift & 2047]++] = i;
            items.swap(sorted);
        }
    }

    std::ptrdiff_t first_;
    std::vector<std::uint32_t> ranks_;
    std::vector<float> values_;
};

/// The window's ranks, moved along a row.
class MedianWindow {
 public:
    MedianWindow(const Tile& t, const Ranks& ranks, int radius)
        : tile_(t), ranks_(ranks), radius_(radius), set_(ranks.size()) {}

    void add(int x, int y, int z) {
        for_column(x, y, z, [this](std::uint32_t rank) { set_.insert(rank); });
    }
    void drop(int x, int y, int z) {
        for_column(x, y, z, [this](std::uint32_t rank) { set_.remove(rank); });
    }
    float median() const {
        const std::size_t n = set_.size();
        const float upper = ranks_.value(set_.find(n / 2));
        if (n % 2) return upper;
        const double lower = ranks_.value(set_.find(n / 2 - 1));
        return static_cast<float>((lower + upper) / 2);
    }

 private:
    template <class Body>
    void for_column(int x, int y, int z, const Body& body) {
        for (int i = x - radius_; i <= x + radius_; ++i) {
            const std::uint32_t* rank = ranks_.at(tile_.at(i, y - radius_, z));
            for (int j = 0; j <= 2 * radius_; ++j, rank += tile_.stride_y)
                if (*rank != Ranks::none) body(*rank);
        }
    }

    const Tile& tile_;
    const Ranks& ranks_;
    int radius_;
    RankSet set_;
};

void median_tile(Tile& t, int radius) {
    const Ranks ranks(t);
    MedianWindow window(t, ranks, radius);
    for (int x = 0; x < size_x; ++x)
        for (int y = 0; y < size_y; ++y) {
            const RowSpan span = t.span(x, y);
            const int begin = std::max<int>(span.begin, 0), end = std::min<int>(span.end, size_z);
            if (begin >= end) continue;
            for (int z = begin - radius; z < begin + radius; ++z) window.add(x, y, z);
            for (int z = begin; z < end; ++z) {
                window.add(x, y, z + radius);
                if (t.active[t.at(x, y, z)] > 0) t.out[0][t.at(x, y, z)] = window.median();
                window.drop(x, y, z - radius);
            }
            for (int z = end - radius; z < end + radius; ++z) window.drop(x, y, z);
        }
}

class Bilateral {
 public:
    explicit Bilateral(const BilateralOptions& o)
        : o_(o),
          reach_(static_cast<int>(2 * o.sigma)),
          over_range_(static_cast<float>(std::min(1 / o.range, 1e30))) {
        one_.fill(1);
    }
    int reach() const { return reach_; }

    void tile(Tile& t) const {
        for (int x = 0; x < size_x; ++x)
            for (int y = 0; y < size_y; ++y)
                if (t.span(x, y).begin < t.span(x, y).end) row(t, x, y);
    }

 private:
    using Line = std::array<float, size_z>;

    void row(Tile& t, int x, int y) const {
        const std::ptrdiff_t o = t.at(x, y, 0);
        std::array<double, size_z> sum{}, norm{};
        for (int dx = -reach_; dx <= reach_; ++dx)
            for (int dy = -reach_; dy <= reach_; ++dy) {
                Line part_sum{}, part_norm{};  // single precision is enough for a line of the window
                for (int dz = -reach_; dz <= reach_; ++dz) {
                    const double distance2 = dx * dx + dy * dy + dz * dz;
                    if (distance2 > 4 * o_.sigma * o_.sigma) continue;
                    const auto nearness =
                        static_cast<float>(std::exp(-distance2 / (2 * o_.sigma * o_.sigma)));
                    add(t.in[0] + o, t.in[0] + t.at(x + dx, y + dy, dz), t.active + t.at(x + dx, y + dy, dz),
                        nearness, part_sum, part_norm);
                }
                for (std::size_t z = 0; z < size_z; ++z) {
                    sum[z] += part_sum[z];
                    norm[z] += part_norm[z];
                }
            }
        for (std::size_t z = 0; z < size_z; ++z) {
            const std::ptrdiff_t at = o + static_cast<std::ptrdiff_t>(z);
            if (t.active[at] > 0) t.out[0][at] = static_cast<float>(t.in[0][at] + sum[z] / norm[z]);
        }
    }

    /// Adds g (there − here) and g to the sums.
    void add(const float* here, const float* there, const float* active, float nearness, Line& sum,
             Line& norm) const {
        Line difference, square, g;
        for (std::size_t z = 0; z < size_z; ++z) {
            difference[z] = there[z] - here[z];
            const float scaled = difference[z] * over_range_;
            square[z] = scaled * scaled;
        }
        stencil::kernels().edge_stopping(size_z, square.data(), one_.data(), active, nearness, g.data());
        for (std::size_t z = 0; z < size_z; ++z) {
            const float w = g[z] > 0 ? g[z] : 0;  // voxels that are not active have a negative one
            sum[z] += w * difference[z];
            norm[z] += w;
        }
    }

    BilateralOptions o_;
    int reach_;
    float over_range_;
    Line one_;
};

}  // namespace

void gaussian_filter(openvdb::FloatGrid& grid, double sigma, const Progress& progress) {
    check_width(sigma);
    if (sigma == 0) return;
    const std::vector<float> g = gaussian_taps(sigma);
    filter(
        grid, static_cast<int>(g.size()) - 1, true, [&](Tile& t) { gaussian_tile(t, g); }, progress);
}

void median_filter(openvdb::FloatGrid& grid, int radius, const Progress& progress) {
    if (radius < 0 || radius > 8)
        throw InvalidInput(fmt::format("the radius of a median is {}: 0 to 8", radius));
    if (radius == 0) return;
    filter(
        grid, radius, false, [&](Tile& t) { median_tile(t, radius); }, progress);
}

void BilateralOptions::check() const {
    check_width(sigma);
    if (!(sigma > 0)) throw InvalidInput("the standard deviation in space is above 0");
    if (!(std::isfinite(range) && range > 0))
        throw InvalidInput("the standard deviation in density is a number above 0");
}

void bilateral_filter(openvdb::FloatGrid& grid, const BilateralOptions& options, const Progress& progress) {
    options.check();
    const Bilateral work(options);
    filter(
        grid, work.reach(), true, [&](Tile& t) { work.tile(t); }, progress);
}

}  // namespace vdbgeo
