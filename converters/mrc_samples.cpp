#include "converters/mrc_samples.h"

#include <cmath>
#include <cstring>
#include <limits>

namespace vdbgeo {

namespace {

template <class T>
T bits_as(std::uint32_t bits) {
    T value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

std::uint32_t bits_of(float value) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
}

std::uint16_t load16(const unsigned char* in, std::size_t i, bool swapped) {
    std::uint16_t value;
    std::memcpy(&value, in + 2 * i, 2);
    return swapped ? static_cast<std::uint16_t>(value << 8 | value >> 8) : value;
}

// `swapped` is a template parameter so that the loops have no branch and vectorise.
template <bool swapped, class Convert>
void loop16(const unsigned char* in, float* out, std::size_t count, Convert convert) {
    for (std::size_t i = 0; i < count; ++i) out[i] = convert(load16(in, i, swapped));
}

template <class Convert>
void loop16(bool swapped, const unsigned char* in, float* out, std::size_t count, Convert convert) {
    if (swapped)
        loop16<true>(in, out, count, convert);
    else
        loop16<false>(in, out, count, convert);
}

template <class T>
std::size_t to_integers(const float* in, void* out, std::size_t count) {
    constexpr float lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
    unsigned char* bytes = static_cast<unsigned char*>(out);
    for (std::size_t i = 0; i < count; ++i) {
        if (!(in[i] >= lowest && in[i] <= highest) || in[i] != std::floor(in[i])) return i;
        const T value = static_cast<T>(in[i]);
        std::memcpy(bytes + i * sizeof(T), &value, sizeof(T));
    }
    return count;
}

std::size_t to_halves(const float* in, void* out, std::size_t count) {
    unsigned char* bytes = static_cast<unsigned char*>(out);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint16_t half = float_to_half(in[i]);
        if ((half & 0x7fff) == 0x7c00 && !std::isinf(in[i])) return i;
        std::memcpy(bytes + 2 * i, &half, 2);
    }
    return count;
}

std::size_t to_nibbles(const float* in, void* out, std::size_t count) {
    unsigned char* bytes = static_cast<unsigned char*>(out);
    for (std::size_t i = 0; i < count; ++i) {
        if (!(in[i] >= 0 && in[i] <= 15) || in[i] != std::floor(in[i])) return i;
        const int value = static_cast<int>(in[i]);
        bytes[i / 2] = static_cast<unsigned char>(i % 2 ? bytes[i / 2] | value << 4 : value);
    }
    return count;
}

}  // namespace

SampleType sample_type(int mode, bool unsigned_bytes) {
    switch (mode) {
        case 0:
            return unsigned_bytes ? SampleType::uint8 : SampleType::int8;
        case 1:
            return SampleType::int16;
        case 6:
            return SampleType::uint16;
        case 12:
            return SampleType::float16;
        case 101:
            return SampleType::uint4;
        default:
            return SampleType::float32;
    }
}

const char* name_of(SampleType type) {
    switch (type) {
        case SampleType::int8:
            return "int8";
        case SampleType::uint8:
            return "uint8";
        case SampleType::int16:
            return "int16";
        case SampleType::uint16:
            return "uint16";
        case SampleType::float16:
            return "float16";
        case SampleType::float32:
            return "float32";
        case SampleType::uint4:
            break;
    }
    return "uint4";
}

std::uint64_t row_bytes(SampleType type, std::uint64_t columns) {
    switch (type) {
        case SampleType::int8:
        case SampleType::uint8:
            return columns;
        case SampleType::int16:
        case SampleType::uint16:
        case SampleType::float16:
            return 2 * columns;
        case SampleType::float32:
            return 4 * columns;
        case SampleType::uint4:
            break;
    }
    return (columns + 1) / 2;
}

float half_to_float(std::uint16_t half) {
    // Exponent and mantissa go to their places in a float; a multiplication corrects the exponent's bias, and
    // makes subnormals normal on the way. What lands at 65536 or above was infinity or NaN.
    float magnitude = bits_as<float>(static_cast<std::uint32_t>(half & 0x7fff) << 13) * 0x1p112f;
    std::uint32_t bits = bits_of(magnitude);
    bits |= magnitude >= 65536.f ? 0x7f800000u : 0u;
    return bits_as<float>(bits | static_cast<std::uint32_t>(half & 0x8000) << 16);
}

std::uint16_t float_to_half(float value) {
    const std::uint32_t bits = bits_of(value), magnitude = bits & 0x7fffffff;
    const std::uint32_t sign = bits >> 16 & 0x8000;
    if (magnitude > 0x7f800000) {  // NaN keeps what fits of its payload
        const std::uint32_t payload = magnitude >> 13 & 0x3ff;
        return static_cast<std::uint16_t>(sign | 0x7c00 | (payload ? payload : 0x200));
    }
    if (magnitude >= 0x477ff000)
        return static_cast<std::uint16_t>(sign | 0x7c00);  // 65520 rounds to infinity
    if (magnitude < 0x38800000) {                          // below 2^-14: subnormal, in units of 2^-24
        const float units = std::nearbyint(std::fabs(value) * 0x1p24f);
        return static_cast<std::uint16_t>(sign | static_cast<std::uint32_t>(units));
    }
    const std::uint32_t rounded = magnitude - 0x38000000 + 0xfff + (magnitude >> 13 & 1);
    return static_cast<std::uint16_t>(sign | rounded >> 13);
}

void samples_to_float(SampleType type, bool swapped, const void* in, float* out, std::size_t count) {
    const unsigned char* bytes = static_cast<const unsigned char*>(in);
    switch (type) {
        case SampleType::int8:
            for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::int8_t>(bytes[i]);
            break;
        case SampleType::uint8:
            for (std::size_t i = 0; i < count; ++i) out[i] = bytes[i];
            break;
        case SampleType::int16:
            loop16(swapped, bytes, out, count,
                   [](std::uint16_t v) { return float(static_cast<std::int16_t>(v)); });
            break;
        case SampleType::uint16:
            loop16(swapped, bytes, out, count, [](std::uint16_t v) { return float(v); });
            break;
        case SampleType::float16:
            loop16(swapped, bytes, out, count, half_to_float);
            break;
        case SampleType::float32:
            std::memcpy(out, in, count * sizeof(float));
            if (swapped) swap_floats(out, count);
            break;
        case SampleType::uint4:
            for (std::size_t i = 0; i < count; ++i)
                out[i] = static_cast<float>(bytes[i / 2] >> 4 * (i % 2) & 15);
            break;
    }
}

void swap_floats(float* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        std::uint32_t bits;
        std::memcpy(&bits, values + i, 4);
        bits = __builtin_bswap32(bits);
        std::memcpy(values + i, &bits, 4);
    }
}

std::size_t floats_to_samples(SampleType type, const float* in, void* out, std::size_t count) {
    switch (type) {
        case SampleType::int8:
            return to_integers<std::int8_t>(in, out, count);
        case SampleType::uint8:
            return to_integers<std::uint8_t>(in, out, count);
        case SampleType::int16:
            return to_integers<std::int16_t>(in, out, count);
        case SampleType::uint16:
            return to_integers<std::uint16_t>(in, out, count);
        case SampleType::float16:
            return to_halves(in, out, count);
        case SampleType::float32:
            std::memcpy(out, in, count * sizeof(float));
            return count;
        case SampleType::uint4:
            break;
    }
    return to_nibbles(in, out, count);
}

}  // namespace vdbgeo
