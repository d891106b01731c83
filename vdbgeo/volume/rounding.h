// Rounding of stored values, so that files get smaller, and what it costs.
#pragma once

#include <openvdb/openvdb.h>

namespace vdbgeo {

/// The largest differences between values and what is stored of them. Values that are not finite do not
/// count.
struct RoundingError {
    double largest = 0;  ///< |stored − value|; infinite where the value does not fit
    double largest_relative =
        0;              ///< |stored − value| / |value|, over values other than 0: 1 where one became 0
    openvdb::Coord at;  ///< a voxel with the largest difference: the first by (x, y, z) of several …
    float value = 0;    ///< … and its value before rounding. Both say nothing while `largest` is 0

    /// The larger of both; does not depend on the order of joining.
    void join(const RoundingError& other);
};

/// The nearest 16-bit float (IEEE 754 binary16), ties to even, as OpenVDB stores it: a relative error of at
/// most 2^-11 for magnitudes of 2^-14 … 65504, an error of at most 2^-25 below. Infinite from 65520 on.
float rounded_to_half(float value);

/// What storing the active values as 16-bit floats costs. A tile counts at its first voxel. Parallel.
RoundingError half_rounding_error(const openvdb::FloatGrid& grid);
/// The same for one leaf: for a writer that has no whole grid.
RoundingError half_rounding_error(const openvdb::FloatTree::LeafNodeType& leaf);

/// The same for one value, at `at`.
RoundingError half_rounding_error(float value, const openvdb::Coord& at);

/// Throws InvalidInput, naming the voxel and its value, where a finite value has no finite 16-bit float.
void check_half_range(const RoundingError& half_error);
void check_half_range(const openvdb::FloatGrid& grid);

/// The largest power of two that is not above `requested`. Throws InvalidInput outside 2^-126 … 2^103
/// (1.2e-38 … 1.0e31), beyond which multiples of it are not exact.
float quantisation_step(double requested);

/// The multiple of `step` (from quantisation_step) nearest to the value, ties to the even one: step ·
/// nearbyint(value / step), with +0 for −0. Exact: a multiple of the step is left as it is, and so is every
/// value beyond 2^23 steps, which is one, and what is not finite. The error is at most step / 2.
float quantise(float value, float step);

/// Quantises the active values of a grid (of one leaf) and tells what it cost; what is not active stays.
/// Rounded values have zeros for their last bits, which a compressor finds. Throws InvalidInput where `step`
/// is not a power of two in the range of quantisation_step.
RoundingError quantise(openvdb::FloatGrid& grid, float step);
RoundingError quantise(openvdb::FloatTree::LeafNodeType& leaf, float step);

}  // namespace vdbgeo
