// The sample types of MRC files, to float and back.
#pragma once

#include <cstddef>
#include <cstdint>

namespace vdbgeo {

enum class SampleType { int8, uint8, int16, uint16, float16, float32, uint4 };

/// How the samples of a mode are stored: 1, 6, 12, 101 and 2 name one type each, 0 has bytes of either sign.
SampleType sample_type(int mode, bool unsigned_bytes);

/// "int8", "uint4", …
const char* name_of(SampleType type);

/// Bytes of a row of `columns` samples; rows of 4-bit samples are filled up to whole bytes.
std::uint64_t row_bytes(SampleType type, std::uint64_t columns);

/// Converts `count` samples to float. `swapped`: the samples are not in this machine's byte order. 4-bit
/// samples start in the low half of the first byte. float16 follows IEEE 754, subnormals, infinities and NaN
/// included.
void samples_to_float(SampleType type, bool swapped, const void* in, float* out, std::size_t count);

/// Reverses the bytes of each of `count` floats.
void swap_floats(float* values, std::size_t count);

/// Converts `count` floats to samples in this machine's byte order; float16 rounds to nearest, ties to even.
/// Returns the number of the first value that the type cannot hold (not whole, out of range; for float16 too
/// large), `count` where there is none. The second half of an odd row's last byte is 0 in 4-bit samples.
std::size_t floats_to_samples(SampleType type, const float* in, void* out, std::size_t count);

float half_to_float(std::uint16_t half);
std::uint16_t float_to_half(float value);

}  // namespace vdbgeo
