#include "converters/mrc_header.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <string_view>

namespace vdbgeo {

namespace {

constexpr bool little_endian = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__;

/// The words of a header by their numbers, which start at 1.
class Words {
 public:
    Words(const MrcHeaderBytes& bytes, bool swapped) : bytes_(bytes), swapped_(swapped) {}

    template <class T>
    T get(std::size_t word) const {
        std::uint32_t bits;
        std::memcpy(&bits, bytes_.data() + 4 * (word - 1), 4);
        if (swapped_) bits = __builtin_bswap32(bits);
        T value;
        std::memcpy(&value, &bits, 4);
        return value;
    }
    template <class T, std::size_t n>
    std::array<T, n> get_array(std::size_t word) const {
        std::array<T, n> values;
        for (std::size_t i = 0; i < n; ++i) values[i] = get<T>(word + i);
        return values;
    }
    /// How much speaks for this byte order: sizes, mode and axes in their usual ranges.
    int plausibility() const {
        int score = 0;
        for (std::size_t word = 1; word <= 3; ++word) {
            const std::int32_t n = get<std::int32_t>(word);
            score += n > 0 && n < 1 << 20;
        }
        const std::int32_t mode = get<std::int32_t>(4);
        if (mode >= 0 && mode < 128) score += 3;
        for (std::size_t word = 17; word <= 19; ++word) {
            const std::int32_t axis = get<std::int32_t>(word);
            score += axis >= 1 && axis <= 3;
        }
        return score;
    }

 private:
    const MrcHeaderBytes& bytes_;
    bool swapped_;
};

bool is_swapped(const MrcHeaderBytes& bytes) {
    const int here = Words(bytes, false).plausibility(), there = Words(bytes, true).plausibility();
    if (here != there) return there > here;
    const unsigned char stamp = bytes[212];
    if (stamp == 0x44 || stamp == 0x11) return (stamp == 0x44) != little_endian;
    return false;
}

std::vector<std::string> read_labels(const MrcHeaderBytes& bytes, std::int32_t count) {
    std::vector<std::string> labels;
    for (int i = 0; i < std::clamp(count, 0, 10); ++i) {
        std::string label(reinterpret_cast<const char*>(bytes.data()) + 224 + 80 * i, 80);
        label.erase(std::min(label.find('\0'), label.size()));
        label.erase(label.find_last_not_of(" \t\r\n") + 1);
        for (char& c : label)
            if (static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126) c = '?';
        if (!label.empty()) labels.push_back(label);
    }
    return labels;
}

bool is_text(const unsigned char* bytes, std::size_t count) {
    return count > 0 && std::all_of(bytes, bytes + count, [](unsigned char c) {
               return (c >= 32 && c != 127) || (c >= 9 && c <= 13);
           });
}

// The EM format: a machine code, a type code, and three sizes before 512 + size bytes.
bool is_em_format(const unsigned char* bytes, std::size_t count, std::optional<std::uint64_t> length) {
    constexpr std::array<int, 10> sizes{0, 1, 2, 0, 4, 4, 0, 0, 8, 8};
    if (count < 512 || !length || bytes[0] > 6 || bytes[3] > 9 || sizes[bytes[3]] == 0) return false;
    for (const bool swapped : {false, true}) {
        double expected = sizes[bytes[3]];
        for (int i = 1; i <= 3; ++i) {
            std::uint32_t n;
            std::memcpy(&n, bytes + 4 * i, 4);
            expected *= swapped ? __builtin_bswap32(n) : n;
        }
        if (expected > 0 && expected + 512 == static_cast<double>(*length)) return true;
    }
    return false;
}

}  // namespace

bool readable_mode(std::int32_t mode) {
    return mode == 0 || mode == 1 || mode == 2 || mode == 6 || mode == 12 || mode == 101;
}

MrcHeader decode_mrc_header(const MrcHeaderBytes& bytes) {
    MrcHeader h;
    h.swapped = is_swapped(bytes);
    const Words words(bytes, h.swapped);
    const auto integer = [&](std::size_t word) { return words.get<std::int32_t>(word); };
    h.nx = integer(1), h.ny = integer(2), h.nz = integer(3);
    h.mode = integer(4);
    h.nxstart = integer(5), h.nystart = integer(6), h.nzstart = integer(7);
    h.mx = integer(8), h.my = integer(9), h.mz = integer(10);
    h.cell = words.get_array<float, 3>(11);
    h.angles = words.get_array<float, 3>(14);
    h.mapc = integer(17), h.mapr = integer(18), h.maps = integer(19);
    h.dmin = words.get<float>(20), h.dmax = words.get<float>(21), h.dmean = words.get<float>(22);
    h.ispg = integer(23);
    h.nsymbt = integer(24);
    h.lskflg = integer(25);
    h.skwmat = words.get_array<float, 9>(26);
    h.skwtrn = words.get_array<float, 3>(35);
    std::memcpy(h.exttyp.data(), bytes.data() + 104, 4);
    h.nversion = integer(28);
    h.imod_stamp = integer(39), h.imod_flags = integer(40), h.word41 = integer(41);
    h.origin = words.get_array<float, 3>(50);
    std::memcpy(h.map.data(), bytes.data() + 208, 4);
    std::memcpy(h.machst.data(), bytes.data() + 212, 4);
    h.rms = words.get<float>(55);
    h.nlabl = integer(56);
    h.labels = read_labels(bytes, h.nlabl);
    return h;
}

MrcHeaderBytes encode_mrc_header(const MrcHeader& h) {
    MrcHeaderBytes bytes{};
    const auto put = [&](std::size_t word, auto value) {
        static_assert(sizeof value == 4);
        std::memcpy(bytes.data() + 4 * (word - 1), &value, 4);
    };
    const auto put_three = [&](std::size_t word, auto a, auto b, auto c) {
        put(word, a), put(word + 1, b), put(word + 2, c);
    };
    put_three(1, h.nx, h.ny, h.nz);
    put(4, h.mode);
    put_three(5, h.nxstart, h.nystart, h.nzstart);
    put_three(8, h.mx, h.my, h.mz);
    put_three(11, h.cell[0], h.cell[1], h.cell[2]);
    put_three(14, h.angles[0], h.angles[1], h.angles[2]);
    put_three(17, h.mapc, h.mapr, h.maps);
    put_three(20, h.dmin, h.dmax, h.dmean);
    put(23, h.ispg);
    put(24, h.nsymbt);
    std::memcpy(bytes.data() + 104, h.exttyp.data(), 4);
    put(28, h.nversion);
    put_three(39, h.imod_stamp, h.imod_flags, h.word41);
    put_three(50, h.origin[0], h.origin[1], h.origin[2]);
    std::memcpy(bytes.data() + 208, h.map.data(), 4);
    bytes[212] = bytes[213] = little_endian ? 0x44 : 0x11;
    put(55, h.rms);
    const std::size_t labels = std::min<std::size_t>(h.labels.size(), 10);
    put(56, static_cast<std::int32_t>(labels));
    std::memset(bytes.data() + 224, ' ', 80 * labels);
    for (std::size_t i = 0; i < labels; ++i)
        std::memcpy(bytes.data() + 224 + 80 * i, h.labels[i].data(),
                    std::min<std::size_t>(h.labels[i].size(), 80));
    return bytes;
}

std::string foreign_format(const unsigned char* bytes, std::size_t count,
                           std::optional<std::uint64_t> length) {
    using namespace std::string_view_literals;
    const std::string_view start(reinterpret_cast<const char*>(bytes), count);
    const auto at = [&](std::size_t place, std::string_view magic) {
        return start.size() >= place + magic.size() && start.substr(place, magic.size()) == magic;
    };
    if (at(0, " BDV\0\0\0\0"sv)) return "an OpenVDB file";
    if (at(257, "ustar"sv)) return "a tar archive";
    if (at(0, "PK\3\4"sv)) return "a zip archive";
    if (at(0,
           "\xfd"
           "7zXZ"sv))
        return "xz-compressed (gzip, bzip2 and zstd can be read)";
    if (at(0, "\x1f\x8b"sv) || at(0, "BZh"sv) || at(0, "\x28\xb5\x2f\xfd"sv))
        return "compressed twice or damaged";
    if (at(0, "\x1f\x9d"sv)) return "compressed by compress (gzip, bzip2 and zstd can be read)";
    if (at(0, "\x89HDF"sv)) return "an HDF5 file";
    if (at(0, "\x89PNG"sv)) return "a PNG picture";
    if (at(0, "II*\0"sv) || at(0, "MM\0*"sv) || at(0, "II+\0"sv)) return "a TIFF picture";
    if (at(0, ":-)"sv)) return "a BRIX map";
    if (is_text(bytes, count)) return "text";
    if (is_em_format(bytes, count, length)) return "an EM-format file";
    if (at(36, "\0\x64"sv) || at(36, "\x64\0"sv)) return "a DSN6 map";
    return "";
}

}  // namespace vdbgeo
