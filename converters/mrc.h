// MRC2014 / CCP4 maps: header, reader, writer, and the list of departures from the format.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The 1024-byte header as numbers, in the byte order of this machine. Numbers in comments are the 4-byte
/// words of the MRC2014 specification (Cheng et al. 2015, doi:10.1016/j.jsb.2015.04.002), counted from 1.
struct MrcHeader {
    std::int32_t nx = 0, ny = 0, nz = 0;                 ///< 1–3: columns, rows, sections as stored
    std::int32_t mode = 2;                               ///< 4
    std::int32_t nxstart = 0, nystart = 0, nzstart = 0;  ///< 5–7: number of the first column, row, section
    std::int32_t mx = 0, my = 0, mz = 0;                 ///< 8–10: sampling of the cell along X, Y, Z
    std::array<float, 3> cell{};                         ///< 11–13: cell lengths, Å
    std::array<float, 3> angles{90, 90, 90};             ///< 14–16: cell angles α, β, γ, degrees
    std::int32_t mapc = 1, mapr = 2, maps = 3;           ///< 17–19: axis of columns, rows, sections
    float dmin = 0, dmax = -1, dmean = -2;               ///< 20–22
    std::int32_t ispg = 1;                        ///< 23: space group; 0 image stack, 401+ volume stack
    std::int32_t nsymbt = 0;                      ///< 24: bytes of the extended header
    std::int32_t lskflg = 0;                      ///< 25 of CCP4 files before MRC2014: skew matrix present
    std::array<float, 9> skwmat{};                ///< 26–34 of such files
    std::array<float, 3> skwtrn{};                ///< 35–37 of such files: translation, Å
    std::array<char, 4> exttyp{};                 ///< 27: type of the extended header
    std::int32_t nversion = 0;                    ///< 28: 20140 or 20141 for MRC2014
    std::int32_t imod_stamp = 0, imod_flags = 0;  ///< 39, 40: IMOD's stamp 1146047817 and flags
    std::int32_t word41 = 0;                      ///< 41: 127 behind −128 in word 40 marks scaled bytes
    std::array<float, 3> origin{};                ///< 50–52, Å
    std::array<char, 4> map{};                    ///< 53: "MAP "
    std::array<unsigned char, 4> machst{};        ///< 54: machine stamp
    float rms = -1;                               ///< 55
    std::int32_t nlabl = 0;                       ///< 56
    std::vector<std::string> labels;              ///< 57–256: trimmed text, at most ten
    bool swapped = false;                         ///< the file's byte order is not this machine's
};

/// Which header words give the world position of the first sample. ORIGIN is plausible where it is finite,
/// not zero, and along each axis no further away than ten times the longest edge of the box; NSTART where it
/// is not over ten times both the box and M. A file with ORIGIN at zero and LSKFLG 1 is a CCP4 file older
/// than MRC2014 with a skew transformation, map = S·(world − t): its axes are turned by S⁻¹, and `automatic`
/// adds t.
enum class OriginRule {
    automatic,  ///< ORIGIN where it is set and plausible, else NSTART, else zero
    header,     ///< words 50–52
    nstart,     ///< words 5–7 times the voxel size
    zero,
    given  ///< MrcReadOptions::origin_A
};

struct MrcLayout;  // converters/mrc_layout.h

struct MrcReadOptions {
    enum class Mode0 { automatic, as_signed, as_unsigned };

    Mode0 mode0 = Mode0::automatic;             ///< automatic: signed unless IMOD's stamp says unsigned
    OriginRule origin = OriginRule::automatic;  ///< which words give the origin
    Vec3d origin_A = Vec3d::Zero();             ///< for OriginRule::given, Å
    std::optional<Vec3d> voxel_size_A;          ///< overrides the header's cell; each positive, Å
    int volume = 0;  ///< which volume of a stack of volumes (ISPG 401 and up), from 0

    void check() const;
};

/// Reads the sections of a map file in file order, as float, without ever holding more than is asked for. The
/// name "-" is standard input.
///
/// Modes 0 (int8, or uint8), 1 (int16), 2 (float32), 6 (uint16), 12 (float16), 101 (4-bit); both byte orders;
/// every axis permutation; gzip, bzip2 and zstd by content. Sizes are 64-bit and checked against the length
/// of the file before anything is allocated. A file that is damaged, truncated, of another format or of a
/// mode not supported is refused with InvalidInput: one line with the word, what was expected and what was
/// found; a file that cannot be opened or read is an IoError.
///
/// Voxel size: cell over M, axis by axis, where that is sound; cell over the number of samples where M is not
/// positive, or where M gives an axis over ten times the others and the samples do not; 1 Å where the cell is
/// unset. A cell that is negative or not finite is refused unless `voxel_size_A` is given. Angles that make
/// no cell read as 90°. Bytes marked as scaled (words 40 and 41 are −128 and 127) become (DMAX − DMIN)/255 ·
/// (byte + 128) + DMIN. Each of these departures is in warnings().
class MrcReader {
 public:
    explicit MrcReader(const std::filesystem::path& path, const MrcReadOptions& options = {});
    ~MrcReader();
    MrcReader(MrcReader&&) noexcept;
    MrcReader& operator=(MrcReader&&) noexcept;

    const MrcHeader& header() const;
    /// Origin, axes and size in x, y, z order after the file's axes were put in order.
    const Frame& frame() const;
    /// order()[0] is the axis (0 x, 1 y, 2 z) of the columns (fastest), [1] of the rows, [2] of the sections.
    const std::array<int, 3>& order() const;
    /// The origin rule that was in effect: "header", "nstart", "zero", "given", "nstart+skwtrn", "skwtrn".
    const std::string& origin_rule() const;
    /// What is odd about the file but was understood, one line each. What can be seen only at the end of
    /// compressed data is added when the last section was read.
    const std::vector<std::string>& warnings() const;
    /// M along x, y, z as it was in effect: cell = sampling · voxel size.
    const Vec3i& sampling() const;
    /// "int8", "uint8", "int8 scaled", "int16", "uint16", "float16", "float32" or "uint4".
    const std::string& value_type() const;
    /// Volumes in the file: 1, or more where it is a stack of them.
    int volumes() const;

    /// Sections not yet read (of the chosen volume).
    int sections_left() const;
    /// Reads the next `count` sections, columns fastest, into `out` (count · columns · rows values).
    void read_sections(float* out, int count);

    /// How the samples are stored; for those who take them as they are.
    const MrcLayout& layout() const;
    /// Reads the bytes of the next `count` sections into `out`, or passes over them where that is null.
    void read_raw_sections(void* out, int count);
    /// Descriptor of a plain file, in which sections can be read in any order from layout().data_start on;
    /// else -1.
    int descriptor() const;
    /// Bytes that the file holds unpacked come from "gzip", "bzip2" or "zstd"; empty for a plain file.
    const std::string& compression() const;

 private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Writes what a VDB file has to remember of the map file `file` into `meta`: mrc_file, mrc_mode (that
/// write_mrc should use), mrc_value_type, mrc_axes ("1,2,3": of columns, rows, sections), mrc_origin_rule,
/// mrc_voxel_size and mrc_sampling and mrc_size (along x, y, z), mrc_nstart (words 5–7), mrc_ispg, mrc_labels
/// (one a line), and the header's own statistics mrc_dmin, mrc_dmax, mrc_dmean, mrc_rms.
void store_mrc_metadata(openvdb::MetaMap& meta, const MrcReader& reader, const std::string& file);

/// What departs from MRC2014 in a map file, one line each with the word's number; empty for a flawless file.
/// Reads the data too, since the statistics in the header are compared with it: opens the file more than
/// once, so it cannot be a pipe. Errors as MrcReader.
std::vector<std::string> validate_mrc(const std::filesystem::path& path);

/// What stored numbers mean: value = factor · stored + offset.
struct MrcScaling {
    double factor = 1, offset = 0;
};

struct MrcWriteOptions {
    enum class Compress { by_name, gz };
    enum class Scaling {
        none,       ///< values are stored as they are
        automatic,  ///< modes 0, 1, 6, 101: the range of the values becomes the whole range of the mode; mode
                    ///< 12: scaled only where a value lies beyond ±65504; mode 2: none
        given       ///< MrcWriteOptions::given
    };

    /// 0, 1, 2, 6, 12 or 101. Unset: the mode of the file that the map came from (metadata mrc_mode), else 2.
    std::optional<int> mode;
    Compress compress = Compress::by_name;  ///< by_name: gzip where the name ends in .gz, else plain
    Scaling scaling = Scaling::none;
    MrcScaling given;  ///< for Scaling::given; not in mode 2, which holds every value

    void check() const;
};

/// What was written, as a reader of the file finds it.
struct MrcWriteReport {
    int mode = 2;
    std::optional<MrcScaling> scaling;  ///< unset: the stored numbers are the values
    double largest_error = 0;           ///< of value − (factor · stored + offset), over all finite values
    Statistics statistics;              ///< of the stored numbers
};

/// Writes a map as MRC2014, section by section through MrcSink: dropped voxels get their stored value, the
/// axes the order of the file that the map came from (metadata mrc_axes), so that an unsparsified map gives
/// back the same data bytes. A name ending in .gz, or MrcWriteOptions::compress, makes it a gzip file,
/// compressed on all threads; .bz2 and .zst are not honoured: the file is plain. The name "-" is standard
/// output. A bounded frame gives the box, else the box is that of the active voxels and the origin moves with
/// it. Cell, labels, space group, machine stamp and recomputed statistics are set. A map whose position came
/// from NSTART gets it back there, as long as it still lies on whole steps; else the position goes into
/// ORIGIN and NSTART is kept as it was. In integer modes values must be whole numbers in range, in mode 12
/// not beyond ±65504: InvalidInput otherwise, unless a scaling is asked for. Then stored = round((value −
/// offset)/factor), and a label says so: "vdbgeo: density = FACTOR * stored + OFFSET", to the last bit; MRC
/// has no word for it, readers show the stored numbers. Axes that are turned against x, y, z beyond what cell
/// angles express have no place in an MRC header: InvalidInput. Bytes that were read as unsigned are written
/// so, under IMOD's stamp. The data is gone through once; once more for the range of an automatic scaling,
/// and once more for the statistics where the output is a pipe; with eight sections in memory.
MrcWriteReport write_mrc(const DensityMap& map, const std::filesystem::path& path,
                         const MrcWriteOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
