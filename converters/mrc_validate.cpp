#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "converters/byte_source.h"
#include "converters/mrc.h"
#include "converters/mrc_header.h"
#include "converters/mrc_layout.h"
#include "converters/running_statistics.h"

namespace vdbgeo {

namespace {

using Lines = std::vector<std::string>;

template <class... Args>
void say(Lines& lines, const char* format, const Args&... args) {
    lines.push_back(fmt::format(fmt::runtime(format), args...));
}

MrcHeaderBytes first_bytes(const std::filesystem::path& path) {
    MrcHeaderBytes bytes{};
    ByteSource::open(path)->read(bytes.data(), bytes.size());
    return bytes;
}

std::string hex(const unsigned char* bytes) {
    return fmt::format("{:02x} {:02x} {:02x} {:02x}", bytes[0], bytes[1], bytes[2], bytes[3]);
}

void check_origin(Lines& lines, const MrcHeader& h) {
    for (std::size_t a = 0; a < 3; ++a)
        if (!std::isfinite(h.origin[a]))
            say(lines, "word {}: ORIGIN is {}, expected a number", 50 + a, h.origin[a]);
}

void check_identity(Lines& lines, const MrcHeader& h) {
    if (h.nsymbt > 0) {
        const std::string type(h.exttyp.begin(), h.exttyp.end());
        const std::array known{"CCP4", "MRCO", "SERI", "AGAR", "FEI1", "FEI2", "HDF5"};
        if (std::find(known.begin(), known.end(), type) == known.end())
            say(lines, "word 27: EXTTYP is not one of MRC2014 (bytes {}) though there is an extended header",
                hex(reinterpret_cast<const unsigned char*>(h.exttyp.data())));
    }
    if (h.nversion != 20140 && h.nversion != 20141)
        say(lines, "word 28: NVERSION is {}, expected 20140 or 20141", h.nversion);
    if (std::memcmp(h.map.data(), "MAP ", 4) != 0)
        say(lines, "word 53: the bytes are {}, expected \"MAP \"",
            hex(reinterpret_cast<const unsigned char*>(h.map.data())));
    const bool little = (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__) != h.swapped;
    const unsigned char* stamp = h.machst.data();
    const bool right = little ? stamp[0] == 0x44 && (stamp[1] == 0x44 || stamp[1] == 0x41)
                              : stamp[0] == 0x11 && stamp[1] == 0x11;
    if (!right || stamp[2] != 0 || stamp[3] != 0)
        say(lines, "word 54: the machine stamp is {}, expected {} for {}-endian data", hex(stamp),
            little ? "44 44 00 00 or 44 41 00 00" : "11 11 00 00", little ? "little" : "big");
}

void check_labels(Lines& lines, const MrcHeader& h, const MrcHeaderBytes& bytes) {
    int filled = 0, last = 0;
    bool strange = false;
    for (int i = 0; i < 10; ++i) {
        const unsigned char* label = bytes.data() + 224 + 80 * i;
        bool text = false;
        for (int k = 0; k < 80; ++k) {
            text = text || (label[k] != 0 && !std::isspace(label[k]));
            strange = strange || label[k] > 126 || (label[k] != 0 && label[k] < 32);
        }
        if (text) ++filled, last = i + 1;
    }
    if (filled != h.nlabl) say(lines, "word 56: NLABL is {}, but {} labels have text", h.nlabl, filled);
    if (filled != last) say(lines, "words 57-256: there are empty labels between the filled ones");
    if (strange) say(lines, "words 57-256: the labels have characters that are not ASCII text");
}

// What the reader finds odd departs from the format, but a stack is only worth knowing.
Lines departures(const MrcReader& reader) {
    Lines lines = reader.warnings();
    const auto is_note = [](const std::string& line) { return line.find("the file is a stack of") == 0; };
    lines.erase(std::remove_if(lines.begin(), lines.end(), is_note), lines.end());
    return lines;
}

Statistics measure(const std::filesystem::path& path, const MrcReadOptions& options,
                   RunningStatistics& running, Lines& lines) {
    MrcReader reader(path, options);
    const Vec3i& size = reader.frame().size;
    const std::size_t section =
        static_cast<std::size_t>(size[reader.order()[0]]) * static_cast<std::size_t>(size[reader.order()[1]]);
    Array<float> values;
    while (const int left = reader.sections_left()) {
        const std::size_t fit = std::max<std::size_t>(1, (4u << 20) / section);
        const int count = static_cast<int>(std::min<std::size_t>(static_cast<std::size_t>(left), fit));
        values.resize(section * static_cast<std::size_t>(count));
        reader.read_sections(values.data(), count);
        running.add(values.data(), values.size());
    }
    // The file's length is seen from its last volume, and all else from any.
    if (options.volume == reader.volumes() - 1) lines = departures(reader);
    return running.result();
}

bool close(double found, double header, double scale) {
    return std::abs(found - header) <= 0.01 * std::abs(found) + 1e-6 * scale;
}

// DMAX below DMIN, DMEAN below both, and a negative RMS mean "not determined".
void check_statistics(Lines& lines, const MrcHeader& h, const Statistics& s) {
    if (s.non_finite > 0) say(lines, "data: {} of {} samples are not finite", s.non_finite, s.count);
    if (s.count == s.non_finite) return;
    const double scale = std::max(std::abs(s.min), std::abs(s.max));
    const bool undetermined = h.dmax < h.dmin;
    if (!undetermined && h.dmin != static_cast<float>(s.min))
        say(lines, "word 20: DMIN is {}, the data has {}", h.dmin, s.min);
    if (!undetermined && h.dmax != static_cast<float>(s.max))
        say(lines, "word 21: DMAX is {}, the data has {}", h.dmax, s.max);
    if (!(h.dmean < std::min(h.dmin, h.dmax)) && !close(s.mean, h.dmean, scale))
        say(lines, "word 22: DMEAN is {}, the data has {}", h.dmean, s.mean);
    if (!(h.rms < 0) && !close(s.rms, h.rms, scale))
        say(lines, "word 55: RMS is {}, the data has {}", h.rms, s.rms);
}

}  // namespace

std::vector<std::string> validate_mrc(const std::filesystem::path& path) {
    MrcReadOptions options;
    options.origin = OriginRule::zero;  // ORIGIN is checked here
    Lines lines, about_data;
    MrcHeader h;
    int volumes = 1;
    {
        const MrcReader reader(path, options);
        h = reader.header();
        volumes = reader.volumes();
    }
    check_identity(lines, h);
    check_origin(lines, h);
    check_labels(lines, h, first_bytes(path));
    RunningStatistics running;
    Statistics statistics;
    for (options.volume = 0; options.volume < volumes; ++options.volume)
        statistics = measure(path, options, running, about_data);
    lines.insert(lines.end(), about_data.begin(), about_data.end());
    check_statistics(lines, h, statistics);
    return lines;
}

}  // namespace vdbgeo
