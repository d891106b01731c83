#include "vdbgeo/volume/density_histogram.h"

#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t leaves_together = 1024;
/// Above it neighbouring whole numbers are no longer told apart by floats.
constexpr float largest_whole = 16777216;
/// Maps of more values than this have no steps that a histogram would show, but for those of whole numbers.
constexpr std::size_t most_values = 1024;

/// The different values that occur, in their order, as long as they are few.
class FewValues {
 public:
    void add(float value) {
        if (too_many_ || (!values_.empty() && value == last_)) return;
        last_ = value;
        const auto at = std::lower_bound(values_.begin(), values_.end(), value);
        if (at != values_.end() && *at == value) return;
        values_.insert(at, value);
        if (values_.size() > most_values) forget();
    }
    void join(const FewValues& other) {
        for (const float value : other.values_) add(value);
        if (other.too_many_) forget();
    }
    /// The number of which all differences are multiples, to the rounding of floats; 0 where there is none.
    double step() const {
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 1; i < values_.size(); ++i)
            least = std::min(least, double(values_[i]) - double(values_[i - 1]));
        if (too_many_ || values_.size() < 2) return 0;
        // The least difference is rounded, and that adds up: the whole range tells it better.
        const double range = double(values_.back()) - double(values_.front());
        const double steps = std::round(range / least);
        if (steps > largest_whole) return 0;
        const double step = range / steps;
        const double rounding =
            2e-7 * std::max(std::abs(double(values_.front())), std::abs(double(values_.back())));
        for (const float value : values_) {
            const double at = (double(value) - double(values_.front())) / step;
            if (std::abs(at - std::round(at)) > 0.01 + rounding / step) return 0;
        }
        return rounding < 0.25 * step ? step : 0;
    }

 private:
    void forget() {
        too_many_ = true;
        values_.clear();
    }

    std::vector<float> values_;
    float last_ = 0;
    bool too_many_ = false;
};

struct Range {
    float low = std::numeric_limits<float>::infinity(), high = -low;
    bool whole = true;
    FewValues values;
    std::uint64_t finite = 0, other = 0;

    void add(float value, std::uint64_t n) {
        if (!std::isfinite(value)) {
            other += n;
            return;
        }
        finite += n;
        low = std::min(low, value);
        high = std::max(high, value);
        whole = whole && value == std::floor(value) && std::abs(value) <= largest_whole;
        values.add(value);
    }
    void join(const Range& r) {
        low = std::min(low, r.low);
        high = std::max(high, r.high);
        whole = whole && r.whole;
        values.join(r.values);
        finite += r.finite;
        other += r.other;
    }
};

struct Counts {
    double low = 0, scale = 0;
    std::vector<std::uint64_t> counts;

    void add(float value, std::uint64_t n) {
        if (!std::isfinite(value)) return;
        const double at = (double(value) - low) * scale;
        counts[std::min(counts.size() - 1, static_cast<std::size_t>(std::max(0.0, at)))] += n;
    }
    void join(const Counts& c) {
        for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += c.counts[i];
    }
};

/// add(value, how often) of a copy of `start` for all active voxels, the copies joined.
template <class Sum>
Sum over_active(const openvdb::FloatTree& tree, const Sum& start) {
    const openvdb::tree::LeafManager<const openvdb::FloatTree> leaves(tree);
    Sum all = fixed_order_reduce(
        leaves.leafCount(), leaves_together, start,
        [&](std::size_t begin, std::size_t end) {
            Sum sum = start;
            for (std::size_t i = begin; i < end; ++i)
                for (auto it = leaves.leaf(i).cbeginValueOn(); it; ++it) sum.add(*it, 1);
            return sum;
        },
        [](Sum& sum, const Sum& part) { sum.join(part); });
    auto tile = tree.cbeginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) all.add(*tile, tile.getVoxelCount());
    return all;
}

}  // namespace

DensityHistogram density_histogram(const DensityMap& map, std::size_t bins, const Progress& progress) {
    if (bins < 1) throw InvalidInput("a histogram needs a bin");
    const openvdb::FloatTree& tree = map.grid->constTree();
    const Range range = over_active(tree, Range());
    progress.report(0.5);
    if (range.finite == 0) throw InvalidInput("no voxel has a density: there is no histogram");
    DensityHistogram h;
    h.low = range.low;
    h.high = range.high;
    h.voxels = range.finite;
    h.non_finite = range.other;
    if (const double step = range.whole ? 1 : range.values.step(); step > 0) {
        const double levels = std::round((h.high - h.low) / step) + 1;
        const double together = std::ceil(levels / static_cast<double>(bins));
        bins = static_cast<std::size_t>(std::ceil(levels / together));
        h.low -= step / 2;
        h.high = h.low + together * step * static_cast<double>(bins);
    } else if (!(h.low < h.high)) {
        const double half = std::max(0.5 * std::abs(h.low), double(std::numeric_limits<float>::min()));
        bins = 1;
        h.low -= half;
        h.high += half;
    }
    Counts start{h.low, static_cast<double>(bins) / (h.high - h.low), std::vector<std::uint64_t>(bins, 0)};
    h.counts = over_active(tree, start).counts;
    progress.report(1);
    return h;
}

}  // namespace vdbgeo
