#include "vdbgeo/volume/enclosing_level.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "vdbgeo/volume/map_samples.h"

namespace vdbgeo {
namespace {

constexpr std::size_t bins = 65536;
constexpr int none = -1;

/// Grows with the value; −0 + 0 is +0, so both zeros have one key.
std::uint32_t key_of(float value) {
    const float v = value + 0.0f;
    std::uint32_t bits;
    std::memcpy(&bits, &v, sizeof bits);
    return bits ^ (bits >> 31 ? 0xffffffffu : 0x80000000u);
}

float value_of(std::uint32_t key) {
    const std::uint32_t bits = key ^ (key >> 31 ? 0x80000000u : 0xffffffffu);
    float v;
    std::memcpy(&v, &bits, sizeof v);
    return v;
}

/// The float half-way between two, above `low` also where they are neighbours.
float between(float low, float high) {
    const float middle = static_cast<float>(0.5 * (double(low) + double(high)));
    return middle > low ? middle : high;
}

using Counts = std::vector<std::uint64_t>;

/// What of the second pass concerns bins next to those that hold a level.
struct Ends {
    std::uint32_t lowest = bins, highest = 0;  // of the lower 16 bits
};

class Selection {
 public:
    Selection(const DensityMap& map, const Progress& progress) : map_(map), progress_(progress) {
        // Without a box the background goes on for ever: nothing at or below it encloses a volume.
        floor_ = map.frame.bounded() ? -std::numeric_limits<float>::infinity() : map.grid->background();
    }

    /// The first pass: returns how many samples there are.
    std::uint64_t count_upper() {
        upper_ =
            count(bins, [](Counts& counts, std::uint32_t key, std::uint64_t n) { counts[key >> 16] += n; });
        progress_.report(0.5);
        std::uint64_t all = 0;
        for (const std::uint64_t n : upper_) all += n;
        return all;
    }

    /// The second pass, for the bins that hold the samples of these ranks, 1 being the highest sample.
    void count_lower(const std::vector<std::uint64_t>& ranks) {
        slots_.assign(bins, none);
        std::vector<std::size_t> chosen;
        for (const std::uint64_t rank : ranks) chosen.push_back(bin_of(rank).first);
        std::sort(chosen.begin(), chosen.end());
        chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
        for (const std::size_t bin : chosen) slots_[bin] = static_cast<int>(full_++);
        std::size_t slots = full_;
        for (const std::size_t bin : chosen)
            for (const auto& next : {above(bin), below(bin)})
                if (next && slots_[*next] == none) slots_[*next] = static_cast<int>(slots++);
        ends_.assign(slots - full_, {});
        gather_lower();
        progress_.report(1);
    }

    EnclosingLevels::Choice choose(std::uint64_t wanted) const {
        const auto [bin, over_bin] = bin_of(wanted);
        const std::uint64_t* const lower = lower_.data() + std::size_t(slots_[bin]) * bins;
        std::uint64_t over = over_bin;
        std::size_t low = bins - 1;
        while (over + lower[low] < wanted) over += lower[low--];
        const std::uint64_t with = over + lower[low];
        const float value = value_at(bin, low);
        EnclosingLevels::Choice choice{wanted, {}, {}};
        if (const auto next = next_below(bin, low, lower)) choice.at_least = {between(*next, value), with};
        if (with == wanted && choice.at_least)
            choice.at_most = choice.at_least;
        else if (const auto next = next_above(bin, low, lower))
            choice.at_most = {between(value, *next), over};
        return choice;
    }

    /// Samples above the lowest value, of `all`.
    std::uint64_t above_lowest(std::uint64_t all) const {
        const std::size_t bin = bin_of(all).first;
        const std::uint64_t* const lower = lower_.data() + std::size_t(slots_[bin]) * bins;
        return all - *std::find_if(lower, lower + bins, [](std::uint64_t n) { return n > 0; });
    }

 private:
    template <class Add>
    Counts count(std::size_t size, const Add& add) {
        tbb::enumerable_thread_specific<Counts> parts([&] { return Counts(size); });
        const auto taken = [&](float v) { return v > floor_ && v <= std::numeric_limits<float>::max(); };
        for_each_sample(
            map_,
            [&](const float* values, std::size_t n) {
                Counts& mine = parts.local();
                for (std::size_t i = 0; i < n; ++i)
                    if (taken(values[i])) add(mine, key_of(values[i]), 1);
            },
            [&](float value, std::uint64_t n) {
                if (taken(value)) add(parts.local(), key_of(value), n);
            });
        Counts sum(size);
        for (const Counts& part : parts)
            for (std::size_t i = 0; i < size; ++i) sum[i] += part[i];
        return sum;
    }

    void gather_lower() {
        tbb::enumerable_thread_specific<std::vector<Ends>> parts([&] { return ends_; });
        lower_ = count(full_ * bins, [&](Counts& counts, std::uint32_t key, std::uint64_t n) {
            const int slot = slots_[key >> 16];
            if (slot == none) return;
            const std::uint32_t low = key & 0xffff;
            if (std::size_t(slot) < full_) {
                counts[std::size_t(slot) * bins + low] += n;
                return;
            }
            Ends& ends = parts.local()[std::size_t(slot) - full_];
            ends.lowest = std::min(ends.lowest, low);
            ends.highest = std::max(ends.highest, low);
        });
        for (const std::vector<Ends>& part : parts)
            for (std::size_t i = 0; i < part.size(); ++i) {
                ends_[i].lowest = std::min(ends_[i].lowest, part[i].lowest);
                ends_[i].highest = std::max(ends_[i].highest, part[i].highest);
            }
    }

    /// The bin of the sample of this rank, and the samples in the bins above.
    std::pair<std::size_t, std::uint64_t> bin_of(std::uint64_t rank) const {
        std::uint64_t over = 0;
        std::size_t bin = bins - 1;
        while (over + upper_[bin] < rank) over += upper_[bin--];
        return {bin, over};
    }

    std::optional<std::size_t> above(std::size_t bin) const {
        while (++bin < bins)
            if (upper_[bin] > 0) return bin;
        return {};
    }
    std::optional<std::size_t> below(std::size_t bin) const {
        while (bin-- > 0)
            if (upper_[bin] > 0) return bin;
        return {};
    }

    static float value_at(std::size_t bin, std::size_t low) {
        return value_of(static_cast<std::uint32_t>(bin << 16 | low));
    }

    std::optional<float> next_below(std::size_t bin, std::size_t low, const std::uint64_t* lower) const {
        while (low-- > 0)
            if (lower[low] > 0) return value_at(bin, low);
        const auto next = below(bin);
        if (!next) return {};
        const std::size_t slot = std::size_t(slots_[*next]);
        if (slot >= full_) return value_at(*next, ends_[slot - full_].highest);
        low = bins - 1;
        while (lower_[slot * bins + low] == 0) --low;
        return value_at(*next, low);
    }

    std::optional<float> next_above(std::size_t bin, std::size_t low, const std::uint64_t* lower) const {
        while (++low < bins)
            if (lower[low] > 0) return value_at(bin, low);
        const auto next = above(bin);
        if (!next) return {};
        const std::size_t slot = std::size_t(slots_[*next]);
        if (slot >= full_) return value_at(*next, ends_[slot - full_].lowest);
        low = 0;
        while (lower_[slot * bins + low] == 0) ++low;
        return value_at(*next, low);
    }

    const DensityMap& map_;
    const Progress& progress_;
    float floor_;
    Counts upper_, lower_;
    std::vector<int>
        slots_;  // of each bin: the first `full_` are counted in full, of the others the ends are kept
    std::size_t full_ = 0;
    std::vector<Ends> ends_;
};

}  // namespace

const std::optional<EnclosingLevel>& EnclosingLevels::Choice::nearest() const {
    if (!at_most) return at_least;
    if (!at_least) return at_most;
    return at_least->voxels - wanted <= wanted - at_most->voxels ? at_least : at_most;
}

EnclosingLevels::EnclosingLevels(const DensityMap& map, std::vector<std::uint64_t> voxels,
                                 const Progress& progress) {
    Selection selection(map, progress);
    samples_ = selection.count_upper();
    if (samples_ == 0) return;
    for (std::uint64_t& n : voxels) n = std::clamp<std::uint64_t>(n, 1, samples_);
    voxels.push_back(samples_);  // shows the lowest value
    selection.count_lower(voxels);
    most_ = selection.above_lowest(samples_);
    voxels.pop_back();
    for (const std::uint64_t n : voxels) choices_.push_back(selection.choose(n));
}

std::vector<std::uint64_t> voxels_above(const DensityMap& map, const std::vector<double>& levels) {
    tbb::enumerable_thread_specific<Counts> parts([&] { return Counts(levels.size()); });
    const auto add = [&](Counts& mine, float value, std::uint64_t n) {
        if (std::isfinite(value))
            for (std::size_t k = 0; k < levels.size(); ++k)
                mine[k] += value >= static_cast<float>(levels[k]) ? n : 0;
    };
    for_each_sample(
        map,
        [&](const float* values, std::size_t n) {
            Counts& mine = parts.local();
            for (std::size_t i = 0; i < n; ++i) add(mine, values[i], 1);
        },
        [&](float value, std::uint64_t n) { add(parts.local(), value, n); });
    Counts sum(levels.size());
    for (const Counts& part : parts)
        for (std::size_t k = 0; k < levels.size(); ++k) sum[k] += part[k];
    return sum;
}

}  // namespace vdbgeo
