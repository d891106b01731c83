#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "converters/byte_source.h"
#include "converters/mrc.h"
#include "converters/mrc_header.h"
#include "converters/mrc_layout.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

constexpr std::size_t scratch_bytes = 1 << 20;

MrcHeader read_header(ByteSource& source) {
    MrcHeaderBytes bytes{};
    const std::size_t found = source.read(bytes.data(), bytes.size());
    const std::string& name = source.name();
    if (found == 0 && !source.cut_off())
        throw InvalidInput(name + ": the file is empty, expected an MRC/CCP4 map");
    const std::string packed = source.compression().empty() ? "" : " inside " + source.compression();
    const std::string foreign = foreign_format(bytes.data(), found, source.length());
    if (found < bytes.size()) {
        if (!foreign.empty())
            throw InvalidInput(fmt::format("{}: is {}{}, expected an MRC/CCP4 map", name, foreign, packed));
        throw InvalidInput(
            fmt::format("{}: is shorter than the header: expected at least 1024 bytes{}, found {}{}", name,
                        packed, found, source.cut_off() ? " before the compressed data ends early" : ""));
    }
    const MrcHeader header = decode_mrc_header(bytes);
    try {
        check_mrc_header(header, name);
    } catch (const InvalidInput&) {
        if (foreign.empty()) throw;
        throw InvalidInput(fmt::format("{}: is {}{}, expected an MRC/CCP4 map", name, foreign, packed));
    }
    return header;
}

// The length of packed data is known only after unpacking, which is worth it where an extended header may be
// missing: reading on would take data for header.
std::optional<std::uint64_t> length_of(const ByteSource& source, const std::filesystem::path& path,
                                       const MrcHeader& header) {
    const bool regular = source.length_bound() != std::numeric_limits<std::uint64_t>::max();
    if (source.length() || source.compression().empty() || !regular || header.nsymbt == 0)
        return source.length();
    const std::uint64_t promised = promised_bytes(header);
    const std::uint64_t found = ByteSource::open(path)->skip(promised);
    if (found < promised) return found;
    return std::nullopt;
}

}  // namespace

struct MrcReader::State {
    std::unique_ptr<ByteSource> source;
    MrcHeader header;
    MrcLayout layout;
    std::string value_type;
    int left = 0;
    Array<unsigned char> scratch;

    [[noreturn]] void ends_early() const {
        throw InvalidInput(
            fmt::format("{}: the {}data ends early: expected {} bytes for {} x {} x {} samples of "
                        "mode {} (words 1-4) and their header, found {}",
                        source->name(), source->cut_off() ? source->compression() + " " : "", layout.data_end,
                        header.nx, header.ny, header.nz, header.mode, source->position()));
    }
    void check_left(int count) const {
        if (count < 0 || count > left)
            throw InvalidInput(
                fmt::format("{}: {} sections were asked for, {} are left", source->name(), count, left));
    }
    void fetch(void* out, std::size_t bytes) {
        if (source->read(out, bytes) != bytes) ends_early();
    }
    void read_samples(float* out, std::size_t count) {
        if (layout.type == SampleType::float32) {  // no second copy
            fetch(out, count * sizeof(float));
            if (header.swapped) swap_floats(out, count);
            return;
        }
        scratch.resize(scratch_bytes);
        const std::size_t piece = scratch_bytes / 2;  // even, so that 4-bit pieces start at whole bytes
        for (std::size_t done = 0; done < count; done += piece) {
            const std::size_t n = std::min(piece, count - done);
            fetch(scratch.data(), row_bytes(layout.type, n));
            samples_to_float(layout.type, header.swapped, scratch.data(), out + done, n);
        }
    }
    void took(int count) {
        left -= count;
        if (left == 0 && count > 0) check_end();
    }
    void check_end() {
        if (!layout.last_volume || source->length()) return;
        char extra;
        if (source->read(&extra, 1) == 1)
            layout.warnings.push_back(
                fmt::format("more bytes follow the data: expected {}", layout.data_end));
        else if (source->cut_off())
            ends_early();
    }
};

void MrcReadOptions::check() const {
    if (voxel_size_A && !(voxel_size_A->allFinite() && voxel_size_A->minCoeff() > 0))
        throw InvalidInput("the voxel size has to be positive along each axis, in angstroms");
    if (!origin_A.allFinite()) throw InvalidInput("the origin has to be three numbers, in angstroms");
    if (volume < 0) throw InvalidInput("the number of the volume has to be 0 or more");
}

MrcReader::MrcReader(const std::filesystem::path& path, const MrcReadOptions& options)
    : state_(std::make_unique<State>()) {
    options.check();
    State& s = *state_;
    s.source = ByteSource::open(path);
    s.header = read_header(*s.source);
    s.layout = lay_out(s.header, options, s.source->name(), length_of(*s.source, path, s.header),
                       s.source->length_bound());
    s.value_type = std::string(name_of(s.layout.type)) + (s.layout.byte_scaled ? " scaled" : "");
    s.left = s.layout.sections;
    const std::uint64_t gap = s.layout.data_start - mrc_header_bytes;
    if (s.source->skip(gap) != gap) s.ends_early();
}

MrcReader::~MrcReader() = default;
MrcReader::MrcReader(MrcReader&&) noexcept = default;
MrcReader& MrcReader::operator=(MrcReader&&) noexcept = default;

const MrcHeader& MrcReader::header() const { return state_->header; }
const Frame& MrcReader::frame() const { return state_->layout.frame; }
const std::array<int, 3>& MrcReader::order() const { return state_->layout.order; }
const std::string& MrcReader::origin_rule() const { return state_->layout.origin_rule; }
const std::vector<std::string>& MrcReader::warnings() const { return state_->layout.warnings; }
const Vec3i& MrcReader::sampling() const { return state_->layout.sampling; }
const std::string& MrcReader::value_type() const { return state_->value_type; }
int MrcReader::volumes() const { return state_->layout.volumes; }
int MrcReader::sections_left() const { return state_->left; }

void MrcReader::read_sections(float* out, int count) {
    State& s = *state_;
    s.check_left(count);
    const std::uint64_t rows = s.layout.rows * static_cast<std::uint64_t>(count), columns = s.layout.columns;
    if (s.layout.type == SampleType::uint4 && columns % 2 == 1)  // each row ends with half a byte of nothing
        for (std::uint64_t row = 0; row < rows; ++row) s.read_samples(out + row * columns, columns);
    else
        s.read_samples(out, rows * columns);
    if (s.layout.byte_scaled)
        for (std::uint64_t i = 0; i < rows * columns; ++i) out[i] = s.layout.scale * out[i] + s.layout.shift;
    s.took(count);
}

const MrcLayout& MrcReader::layout() const { return state_->layout; }
int MrcReader::descriptor() const { return state_->source->descriptor(); }
const std::string& MrcReader::compression() const { return state_->source->compression(); }

void MrcReader::read_raw_sections(void* out, int count) {
    State& s = *state_;
    s.check_left(count);
    const std::uint64_t bytes = s.layout.section_bytes * static_cast<std::uint64_t>(count);
    if ((out ? s.source->read(out, bytes) : s.source->skip(bytes)) != bytes) s.ends_early();
    s.took(count);
}

}  // namespace vdbgeo
