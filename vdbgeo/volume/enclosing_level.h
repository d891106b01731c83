// Levels of a map by how many of its samples lie above them: exact selection in two passes.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// A level and the samples at or above it.
struct EnclosingLevel {
    double level = 0;  ///< half-way between two neighbouring sample values, as a 32-bit float
    std::uint64_t voxels = 0;
};

/// The levels of a map that part its samples into those at or above and those below, by the number above. The
/// samples are all those inside the box, dropped ones included (they read as their stored value), or, without
/// a box, the active voxels above the background, which goes on for ever. What is not finite is left out.
class EnclosingLevels {
 public:
    /// Finds the levels for these numbers of voxels (1 and more). A radix select over the 32-bit keys in
    /// which floats are ordered as integers: one pass for all numbers together counts the upper 16 bits, a
    /// second one the lower 16 of those that share a bin with a level. Half a megabyte for each thread, and
    /// in the second pass for each number. Integers are counted, so the result is the same for any number of
    /// threads. Throws Cancelled.
    EnclosingLevels(const DensityMap& map, std::vector<std::uint64_t> voxels, const Progress& progress = {});

    /// Samples in all, and the most that a level can enclose: those above the lowest value.
    std::uint64_t samples() const { return samples_; }
    std::uint64_t most() const { return most_; }

    /// For each number: the level that encloses it and no less, and the one that encloses it and no more,
    /// where there are such levels. Equal where the number is met.
    struct Choice {
        std::uint64_t wanted = 0;
        std::optional<EnclosingLevel> at_least, at_most;

        /// The nearer of the two, the larger of two as near; there is one wherever the map has two values.
        const std::optional<EnclosingLevel>& nearest() const;
    };
    const std::vector<Choice>& choices() const { return choices_; }

 private:
    std::uint64_t samples_ = 0, most_ = 0;
    std::vector<Choice> choices_;
};

/// The samples at or above each level, of all those inside the box or of the active voxels.
std::vector<std::uint64_t> voxels_above(const DensityMap& map, const std::vector<double>& levels);

}  // namespace vdbgeo
