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
    std::array<float, 3> origin{};                ///< 50–52, Å
    std::array<char, 4> map{};                    ///< 53: "MAP "
    std::array<unsigned char, 4> machst{};        ///< 54: machine stamp
    float rms = -1;                               ///< 55
    std::int32_t nlabl = 0;                       ///< 56
    std::vector<std::string> labels;              ///< 57–256: trimmed text, at most ten
    bool swapped = false;                         ///< the file's byte order is not this machine's
};

/// Which header words give the world position of the first sample.
enum class OriginRule {
    automatic,  ///< ORIGIN where it is set and plausible, else NSTART, else zero
    header,     ///< words 50–52
    nstart,     ///< words 5–7 times the voxel size
    zero,
    given  ///< MrcReadOptions::origin_A
};

struct MrcReadOptions {
    enum class Mode0 { automatic, as_signed, as_unsigned };

    Mode0 mode0 = Mode0::automatic;             ///< automatic: signed unless IMOD's stamp says unsigned
    OriginRule origin = OriginRule::automatic;  ///< which words give the origin
    Vec3d origin_A = Vec3d::Zero();             ///< for OriginRule::given, Å
    std::optional<Vec3d> voxel_size_A;          ///< overrides the header's cell; each positive, Å
    int volume = 0;  ///< which volume of a stack of volumes (ISPG 401 and up), from 0

    void check() const;
};

/// Reads the sections of a map file in file order, as float, without ever holding more than is asked for.
///
/// Modes 0 (int8, or uint8), 1 (int16), 2 (float32), 6 (uint16), 12 (float16), 101 (4-bit); both byte orders;
/// every axis permutation; gzip, bzip2 and zstd by content. Sizes are 64-bit and checked against the length
/// of the file before anything is allocated. A file that is damaged, truncated, of another format or of a
/// mode not supported is refused with InvalidInput: one line with the word, what was expected and what was
/// found; a file that cannot be opened or read is an IoError.
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
    /// What is odd about the file but was understood, one line each.
    const std::vector<std::string>& warnings() const;

    /// Sections not yet read (of the chosen volume).
    int sections_left() const;
    /// Reads the next `count` sections, columns fastest, into `out` (count · columns · rows values).
    void read_sections(float* out, int count);

 private:
    struct State;
    std::unique_ptr<State> state_;
};

/// What departs from MRC2014 in a map file, one line each with the word's number; empty for a flawless file.
/// Reads the data too, since the statistics in the header are compared with it. Errors as MrcReader.
std::vector<std::string> validate_mrc(const std::filesystem::path& path);

struct MrcWriteOptions {
    /// 0, 1, 2, 6, 12 or 101. Unset: the mode of the file that the map came from (metadata mrc_mode), else 2.
    std::optional<int> mode;

    void check() const;
};

/// Writes a map as MRC2014, section by section through AtomicFile: dropped voxels get their stored value, the
/// axes the order of the file that the map came from (metadata mrc_axes), so that an unsparsified map gives
/// back the same data bytes. The name's ending .gz, .bz2 or .zst is not honoured: the file is plain.
/// A bounded frame gives the box, else the box is that of the active voxels and the origin moves with it.
/// Cell, ORIGIN, NSTART, labels, machine stamp and recomputed statistics are set. In integer modes values
/// must be whole numbers in range: InvalidInput otherwise (nothing is scaled silently).
void write_mrc(const DensityMap& map, const std::filesystem::path& path, const MrcWriteOptions& options = {},
               const Progress& progress = {});

}  // namespace vdbgeo
