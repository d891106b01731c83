#include "vdbgeo/volume/isovalue.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/enclosing_level.h"
#include "vdbgeo/volume/map_samples.h"

namespace vdbgeo {
namespace {

/// The finite number that a text begins with, and what follows it.
struct NumberAndUnit {
    double number = 0;
    std::string unit;
};

std::optional<NumberAndUnit> number_and_unit(std::string_view text) {
    NumberAndUnit found;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, found.number);
    if (error != std::errc() || !std::isfinite(found.number)) return {};
    found.unit.assign(rest, end);
    return found;
}

std::optional<double> daltons(const NumberAndUnit& mass) {
    double factor = 0;
    if (mass.unit.empty() || mass.unit == "Da") factor = 1;
    if (mass.unit == "kDa") factor = 1e3;
    if (mass.unit == "MDa") factor = 1e6;
    const double number = mass.number * factor;
    if (factor == 0 || !std::isfinite(number)) return {};
    return number;
}

bool take_prefix(std::string_view& text, std::string_view prefix) {
    const bool found = text.substr(0, prefix.size()) == prefix;
    if (found) text.remove_prefix(prefix.size());
    return found;
}

double enclosing(const DensityMap& map, double volume, const std::string& rule, const Progress& progress) {
    const double each = map.frame.voxel_volume();
    const double wanted = std::round(volume / each);
    const auto voxels = static_cast<std::uint64_t>(std::clamp(wanted, 0.0, 1e18));
    const EnclosingLevels levels(map, {voxels}, progress);
    if (levels.most() == 0)
        throw InvalidInput(
            fmt::format("{}: no level of the map encloses a volume: its samples are all equal", rule));
    if (!(wanted >= 1) || voxels > levels.most())
        throw InvalidInput(fmt::format(
            "{}: that are {:.6g} Å^3; expected a volume between {:.6g} Å^3, one voxel, and {:.6g} Å^3, all "
            "voxels above the lowest value",
            rule, volume, each, static_cast<double>(levels.most()) * each));
    const EnclosingLevels::Choice& choice = levels.choices()[0];
    const auto& level = choice.nearest();
    const double error = std::abs(static_cast<double>(level->voxels) - wanted);
    if (error <= 0.1 * wanted) return level->level;
    std::string found;
    for (const auto& next : {choice.at_most, choice.at_least})
        if (next)
            found += fmt::format("{}{:.6g}", found.empty() ? "" : " and ",
                                 static_cast<double>(next->voxels) * each);
    throw InvalidInput(
        fmt::format("{}: no level encloses {:.6g} Å^3, for many samples are equal or were dropped; "
                    "next to it {} Å^3",
                    rule, volume, found));
}

/// Counts of all samples in bins of equal width between two values.
class Histogram {
 public:
    static constexpr std::size_t bins = 65536;

    Histogram(const DensityMap& map, double low, double high) : low_(low), width_((high - low) / bins) {
        tbb::enumerable_thread_specific<std::vector<std::uint64_t>> parts(
            [] { return std::vector<std::uint64_t>(bins); });
        const auto bin_of = [&](float v) {
            return static_cast<std::size_t>(std::clamp((double(v) - low_) / width_, 0.0, bins - 1.0));
        };
        for_each_sample(
            map,
            [&](const float* values, std::size_t n) {
                std::vector<std::uint64_t>& mine = parts.local();
                for (std::size_t i = 0; i < n; ++i)
                    if (std::isfinite(values[i])) ++mine[bin_of(values[i])];
            },
            [&](float value, std::uint64_t n) {
                if (std::isfinite(value)) parts.local()[bin_of(value)] += n;
            });
        for (const auto& part : parts)
            for (std::size_t b = 0; b < bins; ++b) counts_[b] += part[b];
    }

    /// Otsu's level: with w the share of the samples up to bin t and m the sum of their bins over all, the
    /// variance between the classes is (m_all·w − m)² / (w (1−w)).
    double otsu() const {
        double all = 0, sum = 0;
        for (std::size_t b = 0; b < bins; ++b) {
            all += static_cast<double>(counts_[b]);
            sum += static_cast<double>(counts_[b]) * static_cast<double>(b);
        }
        double below = 0, sum_below = 0, best = -1;
        std::size_t best_bin = 0;
        for (std::size_t b = 0; b < bins; ++b) {
            if (counts_[b] == 0) continue;
            below += static_cast<double>(counts_[b]);
            if (below == all) break;
            sum_below += static_cast<double>(counts_[b]) * static_cast<double>(b);
            const double w = below / all, apart = sum / all * w - sum_below / all;
            const double variance = apart * apart / (w * (1 - w));
            if (variance > best) {
                best = variance;
                best_bin = b;
            }
        }
        std::size_t next = best_bin + 1;
        while (next < bins && counts_[next] == 0) ++next;
        // From the upper end of one bin to the lower end of the other: their common edge where they are
        // neighbours.
        return low_ + width_ * 0.5 * static_cast<double>(best_bin + 1 + next);
    }

 private:
    double low_, width_;
    std::vector<std::uint64_t> counts_ = std::vector<std::uint64_t>(bins);
};

double otsu_level(const DensityMap& map) {
    struct Range {
        float low = std::numeric_limits<float>::infinity(), high = -std::numeric_limits<float>::infinity();
        void add(float v) {
            if (!std::isfinite(v)) return;
            low = std::min(low, v);
            high = std::max(high, v);
        }
    };
    tbb::enumerable_thread_specific<Range> parts;
    for_each_sample(
        map,
        [&](const float* values, std::size_t n) {
            Range& mine = parts.local();
            for (std::size_t i = 0; i < n; ++i) mine.add(values[i]);
        },
        [&](float value, std::uint64_t) { parts.local().add(value); });
    Range all;
    for (const Range& part : parts) {
        all.low = std::min(all.low, part.low);
        all.high = std::max(all.high, part.high);
    }
    if (!(all.low < all.high))
        throw InvalidInput("otsu: the map's samples are all equal: there are no two classes");
    return Histogram(map, all.low, all.high).otsu();
}

}  // namespace

Isovalue Isovalue::parse(const std::string& text) {
    if (text == "auto") return {};
    if (text == "otsu") return {Rule::otsu, 0};
    std::string_view rest = text;
    const bool volume = take_prefix(rest, "volume:"), mass = !volume && take_prefix(rest, "mass:");
    if (const auto found = number_and_unit(rest)) {
        if (mass) {
            if (const auto da = daltons(*found)) return {Rule::mass, *da};
        } else if (volume) {
            if (found->unit.empty()) return {Rule::volume, found->number};
        } else {
            if (found->unit.empty()) return {Rule::value, found->number};
            if (found->unit == "sigma") return {Rule::sigma, found->number};
        }
    }
    throw InvalidInput(fmt::format(
        "'{}' is not an isovalue: give a number, a number of sigmas such as 3sigma, volume:V in Å^3, "
        "mass:M in Da, kDa or MDa, otsu, or auto",
        text));
}

std::string Isovalue::text() const {
    switch (rule) {
        case Rule::automatic:
            return "auto";
        case Rule::otsu:
            return "otsu";
        case Rule::sigma:
            return fmt::format("{}sigma", number);
        case Rule::volume:
            return fmt::format("volume:{}", number);
        case Rule::mass:
            return fmt::format("mass:{}", number);
        default:
            return fmt::format("{}", number);
    }
}

double Isovalue::resolve(const Statistics& s, openvdb::GridClass grid_class) const {
    if (rule == Rule::value) return number;
    if (rule == Rule::automatic && grid_class == openvdb::GRID_LEVEL_SET) return 0;
    if (needs_samples())
        throw InvalidInput(
            fmt::format("{}: a level by volume, mass or otsu is not among the statistics of a map, for "
                        "it is found from the samples",
                        text()));
    if (s.count == s.non_finite) throw InvalidInput("the map has no finite sample to take an isovalue from");
    if (rule == Rule::automatic && grid_class == openvdb::GRID_FOG_VOLUME) return 0.5 * s.max;
    return s.mean + (rule == Rule::sigma ? number : 3) * s.rms;
}

double Isovalue::resolve(const DensityMap& map, const Progress& progress) const {
    if (!needs_samples()) return resolve(map.statistics, map.grid->getGridClass());
    if (map.grid->getGridClass() == openvdb::GRID_LEVEL_SET)
        throw InvalidInput(fmt::format(
            "{}: a level set holds distances and no density: its surface is at 0, or give a number", text()));
    progress.report(0);
    if (rule == Rule::otsu) return otsu_level(map);
    return enclosing(map, rule == Rule::mass ? A3_per_dalton * number : number, text(), progress);
}

}  // namespace vdbgeo
