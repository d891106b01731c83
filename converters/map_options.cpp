#include "converters/map_options.h"

#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <cmath>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

ThresholdRule ThresholdRule::parse(const std::string& text) {
    const char* const end = text.data() + text.size();
    ThresholdRule rule;
    const auto [rest, error] = std::from_chars(text.data(), end, rule.number);
    const std::string unit(rest, static_cast<std::size_t>(end - rest));
    if (error != std::errc() || !(unit.empty() || unit == "sigma" || unit == "%"))
        throw InvalidInput(
            fmt::format("'{}' is not a threshold: give a number, a number of sigmas such as 3sigma, or a "
                        "percentile such as 95%",
                        text));
    rule.kind = unit.empty() ? Kind::value : unit == "%" ? Kind::percentile : Kind::sigma;
    rule.check();
    return rule;
}

void ThresholdRule::check() const {
    if (!std::isfinite(number)) throw InvalidInput("the threshold is not a finite number");
    if (kind == Kind::percentile && !(number >= 0 && number <= 100))
        throw InvalidInput(fmt::format("a percentile lies between 0 and 100, not at {}", number));
    if (kind == Kind::fraction && !(number > 0 && number <= 1))
        throw InvalidInput(fmt::format("the fraction to keep is above 0 and at most 1, not {}", number));
}

void MapReadOptions::check() const {
    mrc.check();
    sparsify.check();
    if (bin < 1)
        throw InvalidInput(fmt::format("{} samples cannot be taken together; bin by 1 or more", bin));
    if (crop)
        for (std::size_t a = 0; a < 3; ++a) {
            const int begin = crop->begin[a].value_or(0);
            if (begin < 0 || (crop->end[a] && *crop->end[a] <= begin))
                throw InvalidInput(fmt::format("the crop is empty along {}: {} up to {}", "xyz"[a], begin,
                                               crop -> end[a].value_or(0)));
        }
    if (halo < 0) throw InvalidInput("a halo cannot be negative");
    if (threshold) {
        threshold->check();
        if (sparsify.threshold) throw InvalidInput("two thresholds: one as a value, one as a rule");
    }
    if (quantise) {
        quantise->check();
        if (!(quantise->number > 0) ||
            (quantise->kind != ThresholdRule::Kind::value && quantise->kind != ThresholdRule::Kind::sigma))
            throw InvalidInput("a step of quantisation is above 0: a value, or a number of sigmas");
    }
    if (sparsify.band && needs_selection())
        throw InvalidInput(
            "a band keeps what is near the isovalue: it cannot be joined with a mask, despeckling or a halo");
    if (needs_selection() && mask.empty() && !threshold && !sparsify.threshold)
        throw InvalidInput("despeckling and a halo need a threshold or a mask that says what is kept");
    if (memory && *memory < std::uint64_t(64) << 20) throw InvalidInput("at least 64M of memory are needed");
}

std::uint64_t MapReadOptions::memory_limit() const {
    if (memory) return *memory;
    return static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
           static_cast<std::uint64_t>(::sysconf(_SC_PAGE_SIZE)) / 2;
}

}  // namespace vdbgeo
