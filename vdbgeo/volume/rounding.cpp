#include "vdbgeo/volume/rounding.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using leaf::Leaf;
using openvdb::Coord;

constexpr std::size_t grain = 64;  // leaves
constexpr std::uint32_t infinite = 0x7f800000;

std::uint32_t bits_of(float v) {
    std::uint32_t bits;
    std::memcpy(&bits, &v, sizeof bits);
    return bits;
}

float float_of(std::uint32_t bits) {
    float v;
    std::memcpy(&v, &bits, sizeof v);
    return v;
}

float magnitude_of(float v) { return float_of(bits_of(v) & 0x7fffffff); }

// Written without branches, so that loops over them become vector code.

/// Of a magnitude (sign bit 0).
float half_magnitude(float a) {
    const std::uint32_t bits = bits_of(a);
    // 13 bits go: add nearly half of the last one kept, and all of that half where it is odd.
    const std::uint32_t kept = (bits + 0xfff + (bits >> 13 & 1)) & ~std::uint32_t(0x1fff);
    const std::uint32_t normal = kept >= 0x47800000 ? infinite : kept;  // 65536
    const float subnormal = (a + 0.5f) - 0.5f;                          // the last bit of 0.5 is 2^-24
    const std::uint32_t rounded = bits < 0x38800000 ? bits_of(subnormal) : normal;  // 2^-14
    return float_of(bits >= infinite ? bits : rounded);
}

/// `beyond`: 2^23 steps, whose last bit is the step.
float quantised(float v, float beyond) {
    const float a = magnitude_of(v);
    const std::uint32_t rounded = bits_of((a + beyond) - beyond);
    const std::uint32_t sign = rounded ? bits_of(v) & 0x80000000 : 0;
    return float_of(a < beyond ? rounded | sign : bits_of(v));
}

/// |stored − value|, exact for both kinds of rounding; 0 for what is not finite.
float difference(float value, float stored) {
    const float d = magnitude_of(stored - value);
    return float_of(bits_of(magnitude_of(value)) < infinite ? bits_of(d) : 0);
}

RoundingError error_of(float value, float stored, const Coord& at) {
    RoundingError e;
    e.largest = difference(value, stored);
    if (e.largest == 0) return e;
    e.largest_relative = e.largest / magnitude_of(value);
    e.at = at;
    e.value = value;
    return e;
}

/// Differences of one leaf's active values; the voxel is looked for only once.
RoundingError leaf_error(const Leaf& leaf, const float* values, const float* stored) {
    alignas(64) std::array<float, leaf::size> differences;
    for (std::size_t i = 0; i < leaf::size; ++i) differences[i] = difference(values[i], stored[i]);
    const auto& mask = leaf.getValueMask();
    if (!mask.isOn())
        for (auto off = mask.beginOff(); off; ++off) differences[off.pos()] = 0;
    // Bits of floats that are not negative are in the order of their values.
    std::int32_t most = 0, most_relative = 0;
    for (std::size_t i = 0; i < leaf::size; ++i) {
        const auto d = static_cast<std::int32_t>(bits_of(differences[i]));
        // No difference and no value: 0 / 0 is left out.
        const float relative = differences[i] / magnitude_of(values[i]);
        const std::int32_t r = d ? static_cast<std::int32_t>(bits_of(relative)) : 0;
        most = d > most ? d : most;
        most_relative = r > most_relative ? r : most_relative;
    }
    RoundingError e;
    if (most == 0) return e;
    e.largest = float_of(static_cast<std::uint32_t>(most));
    e.largest_relative = float_of(static_cast<std::uint32_t>(most_relative));
    openvdb::Index i = 0;
    while (static_cast<std::int32_t>(bits_of(differences[i])) != most) ++i;
    e.at = leaf.offsetToGlobalCoord(i);
    e.value = values[i];
    return e;
}

void check_step(float step) {
    int exponent = 0;
    if (!std::isfinite(step) || std::frexp(step, &exponent) != 0.5f || exponent - 1 < -126 ||
        exponent - 1 > 103)
        throw InvalidInput(fmt::format("{} is not a power of two to quantise by", step));
}

float beyond_of(float step) { return step * 0x1p23f; }

RoundingError quantise_leaf(Leaf& leaf, float beyond) {
    alignas(64) std::array<float, leaf::size> stored;
    float* const values = leaf.buffer().data();
    for (std::size_t i = 0; i < leaf::size; ++i) stored[i] = quantised(values[i], beyond);
    const RoundingError error = leaf_error(leaf, values, stored.data());
    if (leaf.getValueMask().isOn())
        std::memcpy(values, stored.data(), sizeof stored);
    else
        for (auto on = leaf.getValueMask().beginOn(); on; ++on) values[on.pos()] = stored[on.pos()];
    return error;
}

/// Over all leaves, in parallel.
template <class Leaves, class Take>
RoundingError join_leaves(const Leaves& leaves, const Take& take) {
    return fixed_order_reduce(
        leaves.size(), grain, RoundingError{},
        [&](std::size_t begin, std::size_t end) {
            RoundingError e;
            for (std::size_t i = begin; i < end; ++i) e.join(take(*leaves[i]));
            return e;
        },
        [](RoundingError& all, const RoundingError& e) { all.join(e); });
}

}  // namespace

void RoundingError::join(const RoundingError& other) {
    largest_relative = std::max(largest_relative, other.largest_relative);
    if (other.largest < largest || other.largest == 0) return;
    if (other.largest == largest && !(other.at < at)) return;
    largest = other.largest;
    at = other.at;
    value = other.value;
}

float rounded_to_half(float value) {
    return float_of(bits_of(half_magnitude(magnitude_of(value))) | (bits_of(value) & 0x80000000));
}

RoundingError half_rounding_error(const Leaf& leaf) {
    alignas(64) std::array<float, leaf::size> stored;
    const float* const values = leaf.buffer().data();
    for (std::size_t i = 0; i < leaf::size; ++i) stored[i] = rounded_to_half(values[i]);
    return leaf_error(leaf, values, stored.data());
}

RoundingError half_rounding_error(const openvdb::FloatGrid& grid) {
    std::vector<const Leaf*> leaves;
    grid.tree().getNodes(leaves);
    RoundingError error = join_leaves(leaves, [](const Leaf& leaf) { return half_rounding_error(leaf); });
    auto tile = grid.cbeginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) error.join(error_of(*tile, rounded_to_half(*tile), tile.getCoord()));
    return error;
}

RoundingError half_rounding_error(float value, const openvdb::Coord& at) {
    RoundingError error;
    if (!std::isfinite(value) || value == 0) return error;
    error.largest = std::abs(double(rounded_to_half(value)) - value);
    error.largest_relative = error.largest / std::abs(double(value));
    error.at = at;
    error.value = value;
    return error;
}

void check_half_range(const RoundingError& half_error) {
    if (std::isfinite(half_error.largest)) return;
    throw InvalidInput(
        fmt::format("the value {} of voxel ({}, {}, {}) does not fit into 16 bits: expected at most 65504 "
                    "in magnitude",
                    half_error.value, half_error.at.x(), half_error.at.y(), half_error.at.z()));
}

void check_half_range(const openvdb::FloatGrid& grid) { check_half_range(half_rounding_error(grid)); }

float quantisation_step(double requested) {
    if (!(requested >= 0x1p-126 && requested < 0x1p104))
        throw InvalidInput(fmt::format(
            "{} is not a step to quantise by: expected a number from 1.2e-38 to 1.0e31", requested));
    return static_cast<float>(std::exp2(std::ilogb(requested)));
}

float quantise(float value, float step) { return quantised(value, beyond_of(step)); }

RoundingError quantise(Leaf& leaf, float step) {
    check_step(step);
    return quantise_leaf(leaf, beyond_of(step));
}

RoundingError quantise(openvdb::FloatGrid& grid, float step) {
    check_step(step);
    const float beyond = beyond_of(step);
    std::vector<Leaf*> leaves;
    grid.tree().getNodes(leaves);
    RoundingError error = join_leaves(leaves, [&](Leaf& leaf) { return quantise_leaf(leaf, beyond); });
    auto tile = grid.beginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        const float stored = quantised(*tile, beyond);
        error.join(error_of(*tile, stored, tile.getCoord()));
        tile.setValue(stored);
    }
    return error;
}

}  // namespace vdbgeo
