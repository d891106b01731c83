#include "converters/mrc_sink.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "converters/gzip_writer.h"
#include "converters/mrc_header.h"
#include "converters/mrc_new_header.h"
#include "converters/mrc_samples.h"
#include "converters/running_statistics.h"
#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

constexpr double largest_half = 65504;

/// The whole numbers that a type holds; of float16 what is finite.
struct Range {
    double low, high;
};

Range range_of(SampleType type) {
    switch (type) {
        case SampleType::int8:
            return {-128, 127};
        case SampleType::uint8:
            return {0, 255};
        case SampleType::int16:
            return {-32768, 32767};
        case SampleType::uint16:
            return {0, 65535};
        case SampleType::uint4:
            return {0, 15};
        default:
            return {-largest_half, largest_half};
    }
}

bool whole_numbers(SampleType type) { return type != SampleType::float16 && type != SampleType::float32; }

std::optional<MrcScaling> scaling_to(SampleType type, const Statistics& values) {
    if (type == SampleType::float32 || values.count == values.non_finite) return std::nullopt;
    MrcScaling scaling;
    if (type == SampleType::float16) {
        const double furthest = std::max(std::abs(values.min), std::abs(values.max));
        if (furthest <= largest_half) return std::nullopt;
        scaling.factor = furthest / largest_half;
        return scaling;
    }
    const Range range = range_of(type);
    if (values.max > values.min) scaling.factor = (values.max - values.min) / (range.high - range.low);
    if (values.max > values.min)
        scaling.offset = values.min - scaling.factor * range.low;
    else
        scaling.offset = values.min;  // one value only: stored as zeros
    return scaling;
}

void set_statistics(MrcHeader& h, const Statistics& s) {
    if (s.count == s.non_finite) return;  // the values that mean "not determined" stay
    h.dmin = static_cast<float>(s.min);
    h.dmax = static_cast<float>(s.max);
    h.dmean = static_cast<float>(s.mean);
    h.rms = static_cast<float>(s.rms);
}

/// Floats → the samples of a file, and what a reader makes of them.
class Packer {
 public:
    Packer(SampleType type, const MrcHeader& header, const Vec3i& first, const std::array<int, 3>& order)
        : type_(type),
          first_(first),
          order_(order),
          mode_(header.mode),
          columns_(static_cast<std::size_t>(header.nx)),
          rows_(static_cast<std::size_t>(header.ny)),
          row_bytes_(row_bytes(type, columns_)) {}

    std::optional<MrcScaling> scaling;

    void pack(const float* values, int section, int count) {
        const std::size_t rows = rows_ * static_cast<std::size_t>(count);
        packed_.resize(rows * row_bytes_);
        seen_.resize(rows * columns_);
        bad_.assign(rows, columns_);
        errors_.assign(rows, 0);
        parallel_for(rows, 16, [&](std::size_t row) { pack_row(values + row * columns_, row); });
        for (std::size_t row = 0; row < rows; ++row)
            if (bad_[row] < columns_) refuse(values[row * columns_ + bad_[row]], section, row, bad_[row]);
        for (const double error : errors_) largest_error_ = std::max(largest_error_, error);
    }

    const Array<char>& packed() const { return packed_; }
    const Array<float>& seen() const { return seen_; }
    double largest_error() const { return largest_error_; }

 private:
    void pack_row(const float* values, std::size_t row) {
        float* seen = seen_.data() + row * columns_;
        char* packed = packed_.data() + row * row_bytes_;
        const MrcScaling s = scaling.value_or(MrcScaling());
        if (scaling)
            for (std::size_t i = 0; i < columns_; ++i) {
                const double stored = (static_cast<double>(values[i]) - s.offset) / s.factor;
                seen[i] = static_cast<float>(whole_numbers(type_) ? std::nearbyint(stored) : stored);
            }
        bad_[row] = floats_to_samples(type_, scaling ? seen : values, packed, columns_);
        if (bad_[row] < columns_) return;
        samples_to_float(type_, false, packed, seen, columns_);
        if (!scaling && type_ != SampleType::float16) return;  // without an error
        double worst = 0;
        for (std::size_t i = 0; i < columns_; ++i)
            if (std::isfinite(values[i]))
                worst = std::max(worst, std::abs(static_cast<double>(values[i]) -
                                                 (s.factor * static_cast<double>(seen[i]) + s.offset)));
        errors_[row] = worst;
    }

    [[noreturn]] void refuse(float value, int section, std::size_t row, std::size_t column) const {
        Vec3i index = first_;
        index[order_[0]] += static_cast<int>(column);
        index[order_[1]] += static_cast<int>(row % rows_);
        index[order_[2]] += section + static_cast<int>(row / rows_);
        const Range range = range_of(type_);
        const std::string scaled =
            scaling ? fmt::format(" scaled by {} from {}", scaling->factor, scaling->offset) : "";
        throw InvalidInput(
            fmt::format("the value {} at voxel ({}, {}, {}){} does not fit into mode {}, expected {}numbers "
                        "from {} to {}; "
                        "mode 2 holds every value",
                        value, index[0], index[1], index[2], scaled, mode_,
                        whole_numbers(type_) ? "whole " : "", range.low, range.high));
    }

    SampleType type_;
    Vec3i first_;
    std::array<int, 3> order_;
    int mode_;
    std::size_t columns_, rows_, row_bytes_;
    Array<char> packed_;
    Array<float> seen_;
    std::vector<std::size_t> bad_;
    std::vector<double> errors_;
    double largest_error_ = 0;
};

MrcHeader header_for(const Frame& frame, const Vec3i& first, const MrcRecord& record,
                     const MrcWriteOptions& options) {
    const int mode = options.mode.value_or(record.mode.value_or(2));
    return new_mrc_header(frame, first, record, mode, mode == 0 && !options.mode && record.unsigned_bytes);
}

bool is_gzip(const std::filesystem::path& path, const MrcWriteOptions& options) {
    return options.compress == MrcWriteOptions::Compress::gz || path.extension() == ".gz";
}

}  // namespace

struct MrcSink::State {
    enum class Pass { range, statistics, writing };

    State(const std::filesystem::path& path, const Frame& frame, const Vec3i& first, const MrcRecord& record,
          const MrcWriteOptions& options, const std::optional<Statistics>& known_values)
        : name(path.string()),
          header(header_for(frame, first, record, options)),
          type(sample_type(header.mode, header.imod_stamp != 0)),
          section_samples(static_cast<std::size_t>(header.nx) * static_cast<std::size_t>(header.ny)),
          packer(type, header, first, record.order),
          file(path),
          gzip(file),
          compressed(is_gzip(path, options)) {
        using Scaling = MrcWriteOptions::Scaling;
        bool scaled = options.scaling == Scaling::given;
        if (scaled && type == SampleType::float32)
            throw InvalidInput("mode 2 holds every value as it is: nothing is scaled");
        if (scaled) packer.scaling = options.given;
        if (options.scaling == Scaling::automatic && type != SampleType::float32) {
            if (known_values)
                packer.scaling = scaling_to(type, *known_values);
            else
                left.push_back(Pass::range);
            scaled = !known_values || packer.scaling;
        }
        // Whole numbers that are stored as they are have the statistics of the values.
        const bool kept = !scaled && type != SampleType::float16;
        if (!file.seekable()) {
            if (known_values && kept)
                known = known_values;
            else
                left.push_back(Pass::statistics);
        }
        left.push_back(Pass::writing);
        passes = static_cast<int>(left.size());
    }

    void take(const float* values, int count) {
        if (section == 0) begin_pass();
        const std::size_t sections = static_cast<std::size_t>(count);
        const Pass pass = left.front();
        const float* seen = values;
        if (pass != Pass::range && type != SampleType::float32) {
            packer.pack(values, section, count);
            seen = packer.seen().data();
        }
        if (!known || pass == Pass::range) running.add_pieces(seen, section_samples, sections);
        if (pass == Pass::writing) {
            if (type == SampleType::float32)
                put(values, section_samples * sections * sizeof(float));
            else
                put(packer.packed().data(), packer.packed().size());
        }
        section += count;
        if (section == header.nz) end_pass();
    }

    MrcWriteReport finish() {
        if (!left.empty())
            throw InvalidInput(fmt::format("{} of {} sections were given, with {} of {} passes to go",
                                           section, header.nz, left.size(), passes));
        if (compressed) gzip.finish();
        if (file.seekable()) {
            set_statistics(header, *known);
            const std::string bytes = header_bytes();
            file.write_at(0, bytes.data(), bytes.size());
        }
        file.commit();
        return {header.mode, packer.scaling, packer.largest_error(), *known};
    }

    /// Sections that are packed at a time: some 16 MB of floats.
    int batch() const {
        if (type == SampleType::float32) return header.nz;
        return static_cast<int>(
            std::clamp<std::size_t>((std::size_t(1) << 22) / section_samples, 1, 1 << 20));
    }

    void begin_pass() {
        running = RunningStatistics();
        if (left.front() != Pass::writing) return;
        if (packer.scaling) state_scaling(header, *packer.scaling);
        if (known) set_statistics(header, *known);
        file.write(header_bytes());
    }

    void end_pass() {
        if (left.front() == Pass::range)
            packer.scaling = scaling_to(type, running.result());
        else if (!known)
            known = running.result();
        left.erase(left.begin());
        section = 0;
    }

    std::string header_bytes() const {
        const MrcHeaderBytes bytes = encode_mrc_header(header);
        if (compressed) return gzip_member(bytes.data(), bytes.size(), 0);
        return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }

    void put(const void* data, std::size_t bytes) {
        if (compressed)
            gzip.write(data, bytes);
        else
            file.write(data, bytes);
    }

    std::string name;
    MrcHeader header;
    SampleType type;
    std::size_t section_samples;
    Packer packer;
    AtomicFile file;
    GzipWriter gzip;
    bool compressed;
    std::vector<Pass> left;  // the running pass first
    int passes = 1, section = 0;
    RunningStatistics running;
    std::optional<Statistics> known;  // of the stored numbers
};

MrcSink::MrcSink(const std::filesystem::path& path, const Frame& frame, const Vec3i& first,
                 const MrcRecord& record, const MrcWriteOptions& options,
                 const std::optional<Statistics>& known) {
    options.check();
    try {
        if (frame.size.minCoeff() < 1) throw InvalidInput("there is no sample to write");
        state_ = std::make_unique<State>(path, frame, first, record, options, known);
    } catch (const InvalidInput& error) {
        throw InvalidInput(path.string() + ": " + error.what());
    }
}

MrcSink::~MrcSink() = default;

int MrcSink::passes() const { return state_->passes; }

void MrcSink::write(const float* sections, int count) {
    State& s = *state_;
    try {
        while (count > 0) {
            if (s.left.empty()) throw InvalidInput("more sections were given than the box has");
            const int n = std::min({count, s.header.nz - s.section, s.batch()});
            s.take(sections, n);
            sections += s.section_samples * static_cast<std::size_t>(n);
            count -= n;
        }
    } catch (const InvalidInput& error) {
        throw InvalidInput(s.name + ": " + error.what());
    }
}

MrcWriteReport MrcSink::finish() {
    try {
        return state_->finish();
    } catch (const InvalidInput& error) {
        throw InvalidInput(state_->name + ": " + error.what());
    }
}

MrcBox mrc_box(const Frame& frame, const openvdb::CoordBBox& active) {
    MrcBox box{frame, Vec3i::Zero()};
    if (frame.bounded()) return box;
    if (active.empty()) throw InvalidInput("the map has neither a box nor an active voxel");
    for (int a = 0; a < 3; ++a) {
        const std::int64_t extent = std::int64_t(active.max()[a]) - active.min()[a] + 1;
        if (extent > std::numeric_limits<std::int32_t>::max())
            throw InvalidInput(
                fmt::format("the map has {} samples along one axis, an MRC file at most 2^31 - 1", extent));
        box.first[a] = active.min()[a];
        box.frame.size[a] = static_cast<int>(extent);
    }
    return box;
}

MrcWriteReport write_sections(const DenseSections& source, MrcSink& sink, const Progress& progress) {
    Array<float> values(source.largest_piece());
    const double whole = static_cast<double>(sink.passes()) * source.sections();
    double done = 0;
    for (int pass = 0; pass < sink.passes(); ++pass)
        for (int section = 0; section < source.sections();) {
            const int count = source.piece(section);
            source.fill(section, values.data());
            sink.write(values.data(), count);
            section += count;
            progress.report((done += count) / whole);
        }
    return sink.finish();
}

MrcWriteReport write_mrc_from(
    const openvdb::MetaMap& meta, const Frame& frame, const openvdb::CoordBBox& active,
    const std::filesystem::path& path, const MrcWriteOptions& options,
    const std::function<DenseSections(const MrcBox&, const std::array<int, 3>&)>& sections,
    const Progress& progress) {
    MrcBox box;
    MrcRecord record;
    try {
        options.check();
        record = recall_mrc_metadata(meta);
        box = mrc_box(frame, active);
    } catch (const InvalidInput& error) {
        throw InvalidInput(path.string() + ": " + error.what());
    }
    MrcSink sink(path, box.frame, box.first, record, options);
    return write_sections(sections(box, record.order), sink, progress);
}

}  // namespace vdbgeo
