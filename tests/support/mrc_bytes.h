// Map files made in memory: any mode, byte order, axes, extended header, and any header word overwritten.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace vdbgeo::test {

/// A valid 4 x 3 x 2 map of 1 Å voxels with the values 0, 1, 2, … unless told otherwise.
struct MrcBytes {
    std::array<std::int32_t, 3> size{4, 3, 2};  ///< columns, rows, sections
    std::int32_t mode = 2;
    std::array<std::int32_t, 3> start{0, 0, 0};
    std::array<std::int32_t, 3> sampling{0, 0, 0};  ///< zeros: the number of samples along x, y, z
    std::array<float, 3> voxel{1, 1, 1};            ///< the cell is this times the sampling
    std::array<float, 3> angles{90, 90, 90};
    std::array<std::int32_t, 3> axes{1, 2, 3};
    std::array<float, 3> origin{0, 0, 0};
    std::int32_t ispg = 1;
    std::string extended, exttyp = "CCP4";
    bool big_endian = false;
    std::vector<double> values;          ///< in file order; empty: 0, 1, 2, … (modulo 16)
    std::map<int, std::uint32_t> words;  ///< header words, from 1, that are overwritten at the end
    std::map<int, std::string> text;     ///< bytes put at the start of a word

    void set(int word, std::int32_t value) { words[word] = static_cast<std::uint32_t>(value); }
    void set(int word, float value) {
        std::uint32_t bits;
        std::memcpy(&bits, &value, 4);
        words[word] = bits;
    }

    std::vector<double> all_values() const {
        if (!values.empty()) return values;
        std::vector<double> counted(static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
                                    static_cast<std::size_t>(size[2]));
        for (std::size_t i = 0; i < counted.size(); ++i) counted[i] = static_cast<double>(i % 16);
        return counted;
    }

    std::string str() const { return header() + extended + data(); }

    std::string header() const {
        std::string bytes(1024, '\0');
        const auto put = [&](int word, auto value) {
            static_assert(sizeof value == 4);
            std::uint32_t bits;
            std::memcpy(&bits, &value, 4);
            for (int b = 0; b < 4; ++b)
                bytes[static_cast<std::size_t>(4 * (word - 1) + (big_endian ? 3 - b : b))] =
                    static_cast<char>(bits >> 8 * b);
        };
        std::array<std::int32_t, 3> m = sampling;
        for (int i = 0; i < 3; ++i) {
            const auto axis = static_cast<std::size_t>(axes[static_cast<std::size_t>(i)] - 1);
            if (axis < 3 && sampling == std::array<std::int32_t, 3>{0, 0, 0})
                m[axis] = size[static_cast<std::size_t>(i)];
        }
        for (int i = 0; i < 3; ++i) {
            const auto k = static_cast<std::size_t>(i);
            put(1 + i, size[k]);
            put(5 + i, start[k]);
            put(8 + i, m[k]);
            put(11 + i, voxel[k] * static_cast<float>(m[k]));
            put(14 + i, angles[k]);
            put(17 + i, axes[k]);
            put(50 + i, origin[k]);
        }
        put(4, mode);
        put_statistics(put);
        put(23, ispg);
        put(24, static_cast<std::int32_t>(extended.size()));
        put(28, std::int32_t(20140));
        put(54, big_endian ? std::uint32_t(0x11110000) : std::uint32_t(0x00004444));
        put(56, std::int32_t(1));
        for (const auto& [word, value] : words) put(word, value);
        auto parts = text;
        parts.insert({{27, exttyp}, {53, "MAP "}, {57, "made for a test"}});
        for (const auto& [word, part] : parts)
            bytes.replace(static_cast<std::size_t>(4 * (word - 1)), part.size(), part);
        return bytes;
    }

    std::string data() const {
        const std::vector<double> all = all_values();
        std::string bytes;
        const auto put = [&](std::uint32_t bits, int count) {
            for (int b = 0; b < count; ++b)
                bytes += static_cast<char>(bits >> 8 * (big_endian ? count - 1 - b : b));
        };
        const std::size_t columns = static_cast<std::size_t>(size[0]);
        for (std::size_t i = 0; i < all.size(); ++i) {
            const auto whole = static_cast<std::uint32_t>(static_cast<std::int64_t>(all[i]));
            const float real = static_cast<float>(all[i]);
            std::uint32_t bits;
            std::memcpy(&bits, &real, 4);
            if (mode == 0) put(whole, 1);
            if (mode == 1 || mode == 6) put(whole, 2);
            if (mode == 2) put(bits, 4);
            if (mode == 12) put(half(all[i]), 2);
            if (mode == 101 && i % columns % 2 == 0) put(whole, 1);
            if (mode == 101 && i % columns % 2 == 1)
                bytes.back() = static_cast<char>(static_cast<std::uint32_t>(bytes.back()) | whole << 4);
        }
        return bytes;
    }

 private:
    template <class Put>
    void put_statistics(const Put& put) const {
        const std::vector<double> all = all_values();
        double low = INFINITY, high = -INFINITY, sum = 0, squares = 0;
        for (const double v : all)
            low = std::fmin(low, v), high = std::fmax(high, v), sum += v, squares += v * v;
        const double mean = sum / static_cast<double>(all.size());
        put(20, static_cast<float>(low));
        put(21, static_cast<float>(high));
        put(22, static_cast<float>(mean));
        put(55, static_cast<float>(
                    std::sqrt(std::fmax(0, squares / static_cast<double>(all.size()) - mean * mean))));
    }

    // Numbers that a half can hold exactly, of normal size, or zero.
    static std::uint32_t half(double value) {
        if (value == 0) return 0;
        int exponent = 0;
        const double fraction = std::frexp(std::fabs(value), &exponent);  // 0.5 <= fraction < 1
        const auto mantissa = static_cast<std::uint32_t>((fraction * 2 - 1) * 1024);
        return (value < 0 ? 0x8000u : 0u) | static_cast<std::uint32_t>(exponent - 1 + 15) << 10 | mantissa;
    }
};

}  // namespace vdbgeo::test
