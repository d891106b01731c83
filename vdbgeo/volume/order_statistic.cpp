#include "vdbgeo/volume/order_statistic.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t bins = 65536;
constexpr std::size_t block = 1 << 16;  // samples that are counted in one go

std::uint32_t bits_of(float v) {
    std::uint32_t bits;
    std::memcpy(&bits, &v, sizeof bits);
    return bits;
}

/// Grows with the value; −0 + 0 is +0, so both zeros have one key.
std::uint32_t key_of(float v) {
    const std::uint32_t bits = bits_of(v + 0.0f);
    return bits ^ ((bits >> 31 ? 0xffffffffu : 0x80000000u));
}

float value_of(std::uint32_t key) {
    const std::uint32_t bits = key ^ (key >> 31 ? 0x80000000u : 0xffffffffu);
    float v;
    std::memcpy(&v, &bits, sizeof v);
    return v;
}

/// Infinities and NaN fill whole bins at either end, by their exponent: they are left out after counting.
constexpr std::size_t first_finite = 0x0080, end_finite = 0xff80;

/// One thread's counts. Neighbours are often in one bin: two tables in turns, so that one addition need not
/// wait for the other.
struct Counts {
    std::vector<std::uint64_t> tables = std::vector<std::uint64_t>(2 * bins);
    std::uint32_t low_bits = 0;  // of all samples, or-ed

    void take_upper(const float* values, std::size_t count) {
        std::uint64_t* const even = tables.data();
        std::uint64_t* const odd = even + bins;
        std::array<std::uint32_t, 16> keys;
        std::uint32_t low = 0;
        std::size_t i = 0;
        for (; i + keys.size() <= count; i += keys.size()) {
            for (std::size_t k = 0; k < keys.size(); ++k) {
                low |= bits_of(values[i + k]);
                keys[k] = key_of(values[i + k]) >> 16;
            }
            for (std::size_t k = 0; k < keys.size(); k += 2) ++even[keys[k]], ++odd[keys[k + 1]];
        }
        for (; i < count; ++i) {
            low |= bits_of(values[i]);
            ++even[key_of(values[i]) >> 16];
        }
        low_bits |= low & 0xffff;
    }

    void take_lower(const float* values, std::size_t count, std::uint32_t bin) {
        constexpr std::size_t group = 16;
        for (std::size_t i = 0; i < count; i += group) {
            const std::size_t n = std::min(group, count - i);
            std::uint32_t any = 0;
            if (n == group)
                for (std::size_t k = 0; k < group; ++k) any |= key_of(values[i + k]) >> 16 == bin;
            if (n == group && !any) continue;
            for (std::size_t k = 0; k < n; ++k) {
                const std::uint32_t key = key_of(values[i + k]);
                if (key >> 16 == bin) ++tables[(k & 1) * bins + (key & 0xffff)];
            }
        }
    }
};

}  // namespace

struct OrderStatistic::State {
    double fraction = 0;
    int pass = 0;
    bool done = false;
    std::uint64_t count = 0;      // finite samples
    std::uint64_t rank = 0;       // in the chosen bin, after the first pass
    std::uint64_t in_chosen = 0;  // samples of the chosen bin
    std::uint32_t chosen = 0, key = 0;
    tbb::enumerable_thread_specific<Counts> counts;

    /// The threads' counts together, which are empty afterwards.
    std::vector<std::uint64_t> gather(std::uint32_t& low_bits, Team* team) {
        std::vector<std::uint64_t> sum(bins);
        for (const Counts& c : counts) {
            low_bits |= c.low_bits;
            for (std::size_t b = 0; b < bins; ++b) sum[b] += c.tables[b] + c.tables[bins + b];
        }
        counts.clear();
        if (!team) return sum;
        // The bits that were set anywhere: how often each was.
        for (int b = 0; b < 16; ++b) sum.push_back(low_bits >> b & 1);
        team->add_up(sum);
        for (std::size_t b = 0; b < 16; ++b) low_bits |= sum[bins + b] > 0 ? 1u << b : 0;
        sum.resize(bins);
        return sum;
    }

    /// The bin that holds the sample of rank `rank`, which becomes the rank in that bin.
    std::uint32_t find(const std::vector<std::uint64_t>& sum, std::size_t begin) {
        while (rank >= sum[begin]) rank -= sum[begin++];
        return static_cast<std::uint32_t>(begin);
    }

    void end_first(Team* team) {
        std::uint32_t low_bits = 0;
        const std::vector<std::uint64_t> sum = gather(low_bits, team);
        for (std::size_t b = first_finite; b < end_finite; ++b) count += sum[b];
        done = count == 0;
        if (done) return;
        // A fraction such as 0.55 is rounded, and may come out just above the whole number that is meant.
        const double n = static_cast<double>(count), exact = fraction * n, whole = std::round(exact);
        const double wanted = (std::abs(exact - whole) <= 1e-15 * n ? whole : std::ceil(exact)) - 1;
        rank = wanted > 0 ? std::min(static_cast<std::uint64_t>(wanted), count - 1) : 0;
        chosen = find(sum, first_finite);
        in_chosen = sum[chosen];
        // Without lower bits a bin has one value; those of a negative number are all set in its key.
        key = chosen << 16 | (chosen < 0x8000 ? 0xffff : 0);
        done = low_bits == 0;
    }

    void end_second(Team* team) {
        std::uint32_t low_bits = 0;
        const std::vector<std::uint64_t> sum = gather(low_bits, team);
        std::uint64_t seen = 0;
        for (const std::uint64_t n : sum) seen += n;
        if (seen != in_chosen)
            throw InvalidInput(fmt::format(
                "the samples changed between two passes over them: {} are near the percentile, and {} were",
                seen, in_chosen));
        key = chosen << 16 | find(sum, 0);
        done = true;
    }
};

OrderStatistic::OrderStatistic(double fraction) : state_(std::make_unique<State>()) {
    if (!(fraction >= 0 && fraction <= 1))
        throw InvalidInput(fmt::format("a percentile's fraction lies in 0…1, not at {}", fraction));
    state_->fraction = fraction;
}

OrderStatistic::~OrderStatistic() = default;
OrderStatistic::OrderStatistic(OrderStatistic&&) noexcept = default;
OrderStatistic& OrderStatistic::operator=(OrderStatistic&&) noexcept = default;

void OrderStatistic::add(const float* values, std::size_t count) {
    State& s = *state_;
    if (s.done || count == 0) return;
    const auto take = [&](std::size_t begin, std::size_t end) {
        Counts& mine = s.counts.local();
        if (s.pass == 0) mine.take_upper(values + begin, end - begin);
        if (s.pass == 1) mine.take_lower(values + begin, end - begin, s.chosen);
    };
    if (count <= block) return take(0, count);
    parallel_blocks(count, block, take);
}

void OrderStatistic::end_pass(Team* team) {
    State& s = *state_;
    if (s.done) return;
    s.pass == 0 ? s.end_first(team) : s.end_second(team);
    ++s.pass;
}

bool OrderStatistic::done() const { return state_->done; }

std::uint64_t OrderStatistic::count() const { return state_->count; }

float OrderStatistic::value() const {
    if (!state_->done) throw std::logic_error("a percentile is known once its passes are done");
    if (state_->count == 0) throw InvalidInput("there is no finite sample to take a percentile of");
    return value_of(state_->key);
}

}  // namespace vdbgeo
