// Exact percentiles of samples that are too many to hold: two passes over them, a megabyte a thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "vdbgeo/core/team.h"

namespace vdbgeo {

/// The sample of rank ceil(fraction · n) − 1 (at least 0) among the n finite samples in ascending order: what
/// std::nth_element would find, by a radix select over the 32-bit keys in which floats are ordered as
/// integers. The first pass counts the keys by their upper 16 bits, the second the lower 16 of those in the
/// bin that holds the rank. −0 and +0 are equal (the value is then +0); what is not finite is left out.
///
///     OrderStatistic median(0.5);
///     while (!median.done()) {
///         for (...) median.add(values, count);     // the same samples in each pass, in any order and
///         portions median.end_pass();
///     }
///     float level = median.value();
///
/// Counts are integers, so the value is the same for any number of threads. Cost: about a nanosecond a sample
/// and pass on one core; a megabyte for each thread.
class OrderStatistic {
 public:
    /// At most so many passes are needed. One is enough where no sample has more than eight significant bits
    /// (maps of bytes).
    static constexpr int passes = 2;

    /// `fraction`: 0 is the smallest sample, 1 the largest. Throws InvalidInput outside 0…1.
    explicit OrderStatistic(double fraction);
    ~OrderStatistic();
    OrderStatistic(OrderStatistic&&) noexcept;
    OrderStatistic& operator=(OrderStatistic&&) noexcept;

    /// Counts samples, in parallel where they are many. May be called from several threads at once.
    void add(const float* values, std::size_t count);

    /// All samples of this pass have been added, by all members where there is a team. Throws InvalidInput
    /// when they were not those of the first pass.
    void end_pass(Team* team = nullptr);

    /// Nothing is left to find: further samples are not looked at.
    bool done() const;

    /// Finite samples, known after the first pass.
    std::uint64_t count() const;

    /// The sample asked for, once done. Throws InvalidInput when there is no finite sample.
    float value() const;

 private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace vdbgeo
