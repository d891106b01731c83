#include "converters/strip_source.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <future>

#include "converters/mrc_layout.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/scratch_file.h"

namespace vdbgeo {
namespace {

using Bytes = Array<unsigned char>;

/// What one thread works in.
struct Scratch {
    Bytes raw;
    Array<std::int16_t> integers;
    Array<float> floats, row;
    Array<double> sums;
};

bool fits_16_bits(SampleType type) { return type != SampleType::float32 && type != SampleType::float16; }

/// `count` integer samples as 16-bit ones, less the type's bias.
void samples_to_integers(SampleType type, bool swapped, const unsigned char* in, std::int16_t* out,
                         std::size_t count) {
    switch (type) {
        case SampleType::int8:
            for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::int8_t>(in[i]);
            return;
        case SampleType::uint8:
            for (std::size_t i = 0; i < count; ++i) out[i] = in[i];
            return;
        case SampleType::uint4:
            for (std::size_t i = 0; i < count; ++i) out[i] = in[i / 2] >> 4 * (i % 2) & 15;
            return;
        default:
            break;
    }
    const int flip = type == SampleType::uint16 ? 0x8000 : 0;
    std::memcpy(out, in, 2 * count);
    if (swapped)
        for (std::size_t i = 0; i < count; ++i)
            out[i] = static_cast<std::int16_t>(__builtin_bswap16(static_cast<std::uint16_t>(out[i])));
    if (flip)
        for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::int16_t>(out[i] ^ flip);
}

int bias_of(SampleType type) { return type == SampleType::uint16 ? 32768 : 0; }

}  // namespace

struct StripSource::State {
    std::string name;
    MrcReader reader;
    const MrcLayout& layout = reader.layout();
    const bool swapped = reader.header().swapped;
    int bin = 1;
    bool invert = false, scaled = false;
    double shift = 0, factor = 1;
    std::array<int, 3> first{},
        count{};  // along columns, rows, sections: where the crop begins; samples handed out
    Frame frame;
    std::vector<std::string> warnings;
    std::optional<Range> range;
    bool unpack_first = false;
    std::filesystem::path unpack_to;
    std::optional<ScratchFile> unpacked;
    std::uint64_t unpacked_bytes = 0;
    tbb::enumerable_thread_specific<Scratch> scratch;

    State(const std::filesystem::path& path, const MapReadOptions& options)
        : name(path.string()), reader(path, options.mrc), bin(options.bin), invert(options.invert) {
        place(options);
    }

    void place(const MapReadOptions& options);
    void unpack(const Progress& progress);

    int descriptor() const { return unpacked ? unpacked->descriptor() : reader.descriptor(); }
    bool in_any_order() const { return descriptor() >= 0; }
    std::uint64_t position(std::uint64_t section, std::uint64_t row) const {
        return (unpacked ? 0 : layout.data_start) + section * layout.section_bytes + row * layout.row_bytes;
    }
    void ask_ahead(int section, int sections, int row, int rows) const;
    const unsigned char* rows(const Bytes* slab, int slab_first, int section, int row, int n, Bytes& space,
                              std::size_t at) const;
    Strip strip(const Bytes* slab, int slab_first, int section, int sections, int row, int rows_wanted,
                Scratch& s) const;
    Strip whole_samples(const Bytes* slab, int slab_first, Strip shape, int section, int row,
                        Scratch& s) const;
    Strip binned(const Bytes* slab, int slab_first, Strip shape, int section, int row, Scratch& s) const;
    void to_floats(const unsigned char* raw, float* out) const;
    void finish(float* values, std::size_t n) const;
};

void StripSource::State::place(const MapReadOptions& options) {
    const Frame& whole = reader.frame();
    const auto& order = reader.order();
    Vec3i begin = Vec3i::Zero(), size = whole.size;
    for (int a = 0; a < 3; ++a) {
        const std::size_t i = static_cast<std::size_t>(a);
        if (options.crop) {
            begin[a] = options.crop->begin[i].value_or(0);
            const int end = options.crop->end[i].value_or(whole.size[a]);
            if (begin[a] >= end || end > whole.size[a])
                throw InvalidInput(fmt::format(
                    "{}: the crop {}:{} along {} does not lie in the map, which has {} samples there", name,
                    begin[a], end, "xyz"[a], whole.size[a]));
            size[a] = end - begin[a];
        }
        if (size[a] < bin)
            throw InvalidInput(fmt::format("{}: {} samples along {} are too few to bin by {}", name, size[a],
                                           "xyz"[a], bin));
        if (size[a] % bin != 0)
            warnings.push_back(fmt::format("{} of {} samples along {} are left over by binning and left out",
                                           size[a] % bin, size[a], "xyz"[a]));
        size[a] /= bin;
    }
    frame = whole;
    frame.size = size;
    frame.origin = whole.to_world(begin.cast<double>() + Vec3d::Constant(0.5 * (bin - 1)));
    frame.axes = whole.axes * bin;
    for (int k = 0; k < 3; ++k) {
        const std::size_t i = static_cast<std::size_t>(k);
        first[i] = begin[order[i]];
        count[i] = size[order[i]];
    }
}

void StripSource::State::unpack(const Progress& progress) {
    unpacked.emplace(unpack_to.empty() ? std::filesystem::temp_directory_path() : unpack_to);
    const std::uint64_t piece = std::max<std::uint64_t>(1, (std::uint64_t(8) << 20) / layout.section_bytes);
    Bytes bytes;
    while (reader.sections_left() > 0) {
        const int n = static_cast<int>(
            std::min<std::uint64_t>(piece, static_cast<std::uint64_t>(reader.sections_left())));
        bytes.resize(layout.section_bytes * static_cast<std::uint64_t>(n));
        reader.read_raw_sections(bytes.data(), n);
        unpacked->append(bytes.data(), bytes.size());
        unpacked_bytes += bytes.size();
        progress.report(1 - static_cast<double>(reader.sections_left()) / layout.sections);
    }
}

/// Tells the system which rows of which sections are wanted next, so that the disk works while we do.
void StripSource::State::ask_ahead(int section, int sections, int row, int rows) const {
    const bool whole = static_cast<std::uint64_t>(rows) * layout.row_bytes == layout.section_bytes;
    const std::uint64_t begin = static_cast<std::uint64_t>(section), n = static_cast<std::uint64_t>(sections);
    for (std::uint64_t i = 0; i < (whole ? 1 : n); ++i)
        ::posix_fadvise(
            descriptor(), static_cast<off_t>(position(begin + i, static_cast<std::uint64_t>(row))),
            static_cast<off_t>((whole ? n : 1) * static_cast<std::uint64_t>(rows) * layout.row_bytes),
            POSIX_FADV_WILLNEED);
}

/// `n` rows of a section as they are in the file: out of the slab that was unpacked, or read into `space`.
const unsigned char* StripSource::State::rows(const Bytes* slab, int slab_first, int section, int row, int n,
                                              Bytes& space, std::size_t at) const {
    const std::uint64_t r = static_cast<std::uint64_t>(row);
    if (slab)
        return slab->data() + static_cast<std::uint64_t>(section - slab_first) * layout.section_bytes +
               r * layout.row_bytes;
    unsigned char* out = space.data() + at;
    std::uint64_t left = static_cast<std::uint64_t>(n) * layout.row_bytes,
                  from = position(static_cast<std::uint64_t>(section), r);
    for (unsigned char* to = out; left > 0;) {
        const ssize_t got = ::pread(descriptor(), to, left, static_cast<off_t>(from));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throw IoError(fmt::format("{}: reading failed: {}", name, std::strerror(errno)));
        if (got == 0) throw IoError(name + ": became shorter while it was read");
        to += got;
        from += static_cast<std::uint64_t>(got);
        left -= static_cast<std::uint64_t>(got);
    }
    return out;
}

/// What is done to samples that are floats already.
void StripSource::State::finish(float* values, std::size_t n) const {
    if (layout.byte_scaled)
        for (std::size_t i = 0; i < n; ++i) values[i] = layout.scale * values[i] + layout.shift;
    if (invert)
        for (std::size_t i = 0; i < n; ++i) values[i] = -values[i];
}

/// One row of the file, from the crop's first column on.
void StripSource::State::to_floats(const unsigned char* raw, float* out) const {
    samples_to_float(layout.type, swapped, raw, out, layout.columns);
    finish(out, layout.columns);
}

Strip StripSource::State::whole_samples(const Bytes* slab, int slab_first, Strip shape, int section, int row,
                                        Scratch& s) const {
    const std::size_t rows_in = static_cast<std::size_t>(shape.rows), columns = layout.columns;
    const std::size_t skip = static_cast<std::size_t>(first[0]), piece = rows_in * layout.row_bytes;
    const bool integers = fits_16_bits(layout.type) && !layout.byte_scaled && !scaled;
    const bool as_it_is = !swapped && (integers ? layout.type == SampleType::int16
                                                : layout.type == SampleType::float32 && !invert && !scaled);
    shape.bias = bias_of(layout.type);
    shape.sign = invert ? -1 : 1;
    if (!slab) s.raw.resize(piece * static_cast<std::size_t>(shape.sections));
    shape.row_stride = columns;
    shape.section_stride = as_it_is && slab ? layout.section_bytes / (integers ? 2 : 4) : rows_in * columns;
    if (!as_it_is && integers)
        s.integers.resize(shape.section_stride * static_cast<std::size_t>(shape.sections));
    if (!as_it_is && !integers)
        s.floats.resize(shape.section_stride * static_cast<std::size_t>(shape.sections));
    for (int i = 0; i < shape.sections; ++i) {
        const std::size_t n = static_cast<std::size_t>(i);
        const unsigned char* raw = rows(slab, slab_first, section + i, row, shape.rows, s.raw, n * piece);
        if (as_it_is) {
            if (i > 0) continue;
            if (integers)
                shape.integers = reinterpret_cast<const std::int16_t*>(raw) + skip;
            else
                shape.floats = reinterpret_cast<const float*>(raw) + skip;
            continue;
        }
        for (std::size_t r = 0; r < rows_in; ++r) {
            const std::size_t at = n * shape.section_stride + r * columns;
            if (integers)
                samples_to_integers(layout.type, swapped, raw + r * layout.row_bytes, s.integers.data() + at,
                                    columns);
            else
                to_floats(raw + r * layout.row_bytes, s.floats.data() + at);
        }
    }
    if (as_it_is) return shape;
    if (integers)
        shape.integers = s.integers.data() + skip;
    else
        shape.floats = s.floats.data() + skip;
    return shape;
}

/// Means over bin³ samples, summed in the order of the file.
Strip StripSource::State::binned(const Bytes* slab, int slab_first, Strip shape, int section, int row,
                                 Scratch& s) const {
    const std::size_t columns = static_cast<std::size_t>(shape.columns),
                      out_rows = static_cast<std::size_t>(shape.rows);
    const std::size_t n = static_cast<std::size_t>(bin);
    const int rows_in = shape.rows * bin;
    shape.row_stride = columns;
    shape.section_stride = columns * out_rows;
    s.floats.resize(shape.section_stride * static_cast<std::size_t>(shape.sections));
    s.sums.resize(shape.section_stride);
    s.row.resize(layout.columns);
    if (!slab) s.raw.resize(static_cast<std::size_t>(rows_in) * layout.row_bytes);
    const double weight = 1.0 / (static_cast<double>(bin) * bin * bin);
    for (int out_section = 0; out_section < shape.sections; ++out_section) {
        std::fill(s.sums.begin(), s.sums.end(), 0.0);
        for (int k = 0; k < bin; ++k) {
            const unsigned char* raw =
                rows(slab, slab_first, section + out_section * bin + k, row, rows_in, s.raw, 0);
            for (std::size_t r = 0; r < static_cast<std::size_t>(rows_in); ++r) {
                to_floats(raw + r * layout.row_bytes, s.row.data());
                const float* in = s.row.data() + first[0];
                double* sums = s.sums.data() + r / n * columns;
                for (std::size_t c = 0; c < columns; ++c)
                    for (std::size_t j = 0; j < n; ++j) sums[c] += in[c * n + j];
            }
        }
        float* out = s.floats.data() + static_cast<std::size_t>(out_section) * shape.section_stride;
        for (std::size_t i = 0; i < shape.section_stride; ++i)
            out[i] = static_cast<float>(s.sums[i] * weight);
    }
    shape.floats = s.floats.data();
    return shape;
}

Strip StripSource::State::strip(const Bytes* slab, int slab_first, int section, int sections, int row,
                                int rows_wanted, Scratch& s) const {
    Strip shape;
    shape.columns = count[0];
    shape.rows = rows_wanted;
    shape.sections = sections;
    const int from_section = first[2] + section * bin, from_row = first[1] + row * bin;
    Strip result = bin == 1 ? whole_samples(slab, slab_first, shape, from_section, from_row, s)
                            : binned(slab, slab_first, shape, from_section, from_row, s);
    if (!scaled) return result;
    const std::size_t last = static_cast<std::size_t>(result.sections) * result.section_stride;
    for (std::size_t i = 0; i < last; ++i) s.floats[i] = static_cast<float>((s.floats[i] - shift) * factor);
    return result;
}

StripSource::StripSource(const std::filesystem::path& path, const MapReadOptions& options, int passes)
    : state_(std::make_unique<State>(path, options)) {
    State& s = *state_;
    const std::uint64_t slab = s.layout.section_bytes * static_cast<std::uint64_t>(leaf::dim * s.bin);
    s.unpack_first = !s.in_any_order() && (passes > 1 || 2 * slab > options.memory_limit() / 4);
    s.unpack_to = options.scratch;
}

StripSource::~StripSource() = default;

const MrcReader& StripSource::reader() const { return state_->reader; }
const Frame& StripSource::frame() const { return state_->frame; }
const std::array<int, 3>& StripSource::first() const { return state_->first; }
const std::array<int, 3>& StripSource::order() const { return state_->reader.order(); }
std::uint64_t StripSource::unpacked() const { return state_->unpacked_bytes; }

std::vector<std::string> StripSource::warnings() const {
    std::vector<std::string> all = state_->reader.warnings();
    all.insert(all.end(), state_->warnings.begin(), state_->warnings.end());
    return all;
}

void StripSource::restrict_to(const Range& range) { state_->range = range; }

void StripSource::scale(double shift, double factor) {
    state_->shift = shift;
    state_->factor = factor;
    state_->scaled = true;
}

void StripSource::pass(const Visit& visit, const Begin& begin, const End& end, const Progress& whole,
                       int height, int group) {
    State& s = *state_;
    const bool unpack = s.unpack_first && !s.unpacked;
    if (unpack) s.unpack(whole.part(0, 0.7));
    const Progress progress = whole.part(unpack ? 0.7 : 0, 1);
    const int sections = s.count[2];
    const Range all{0, (s.count[1] - 1) / leaf::dim + 1, 0, (sections - 1) / height + 1},
        range = s.range.value_or(all);
    if (group <= 0) group = all.end_row;
    const bool any_order = s.in_any_order();
    const auto sections_of = [&](int slab) { return std::min(height, sections - slab * height); };
    const auto first_of = [&](int slab) { return s.first[2] + slab * height * s.bin; };
    Bytes slab_bytes, next_bytes;
    const auto fetch = [&](int slab,
                           Bytes& into) {  // the raw sections of a slab, or word that they will be wanted
        if (slab >= range.end_slab) return;
        const int n = sections_of(slab) * s.bin;
        if (any_order) {
            const bool all_rows = range.first_row == 0 && range.end_row == all.end_row;
            const int row = range.first_row * leaf::dim,
                      rows = std::min(range.end_row * leaf::dim, s.count[1]) - row;
            return s.ask_ahead(first_of(slab), n, all_rows ? 0 : s.first[1] + row * s.bin,
                               all_rows ? static_cast<int>(s.layout.rows) : rows * s.bin);
        }
        into.resize(static_cast<std::uint64_t>(n) * s.layout.section_bytes);
        s.reader.read_raw_sections(into.data(), n);
    };
    if (!any_order) s.reader.read_raw_sections(nullptr, first_of(range.first_slab));
    fetch(range.first_slab, slab_bytes);
    for (int slab = range.first_slab; slab < range.end_slab; ++slab) {
        auto coming = std::async(std::launch::async, [&] { fetch(slab + 1, next_bytes); });
        const Bytes* bytes = any_order ? nullptr : &slab_bytes;
        for (int first = range.first_row; first < range.end_row; first += group) {
            const std::size_t here = static_cast<std::size_t>(std::min(group, range.end_row - first));
            begin(here);
            parallel_for(here, 1, [&](std::size_t i) {
                const int row = first + static_cast<int>(i),
                          rows = std::min(leaf::dim, s.count[1] - row * leaf::dim);
                // Isolated: a loop inside `visit` must not have this thread take up another strip, for which
                // it has only one scratch.
                tbb::this_task_arena::isolate([&] {
                    visit(s.strip(bytes, first_of(slab), slab * height, sections_of(slab), row * leaf::dim,
                                  rows, s.scratch.local()),
                          slab, row, i);
                });
            });
            end();
        }
        coming.get();
        std::swap(slab_bytes, next_bytes);
        progress.report(static_cast<double>(slab + 1 - range.first_slab) /
                        (range.end_slab - range.first_slab));
    }
}

Statistics strip_statistics(StripSource& source, const Progress& progress) {
    SparsifyOptions nothing;  // keeps no sample: only the moments are wanted
    nothing.threshold = std::numeric_limits<float>::max();
    const StripSorter sorter(source.frame().size, source.order(), nothing);
    Moments all;
    std::vector<Moments> parts;
    source.pass([&](const Strip& strip, int slab, int row,
                    std::size_t place) { parts[place] = sorter.sort(strip, slab, row).moments; },
                [&](std::size_t strips) { parts.assign(strips, Moments()); },
                [&] {
                    for (const Moments& part : parts) all.join(part);
                },
                progress);
    return all.statistics();
}

}  // namespace vdbgeo
