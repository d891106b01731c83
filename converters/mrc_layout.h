// What an MRC header means: where the samples are in the file and in the world.
#pragma once

#include "converters/mrc.h"
#include "converters/mrc_samples.h"

namespace vdbgeo {

struct MrcLayout {
    Frame frame;
    std::array<int, 3> order{0, 1, 2};
    Vec3i sampling = Vec3i::Ones();
    std::string origin_rule;
    SampleType type = SampleType::float32;
    bool byte_scaled = false;    ///< value = scale · byte + shift
    float scale = 1, shift = 0;  ///< see byte_scaled
    std::uint64_t columns = 0, rows = 0;
    std::uint64_t row_bytes = 0, section_bytes = 0;
    std::uint64_t data_start = 0;  ///< byte at which the chosen volume starts
    std::uint64_t data_end = 0;    ///< byte after the data of all volumes
    int sections = 0;              ///< of the chosen volume
    int volumes = 1;
    bool last_volume = true;  ///< nothing but the end follows the chosen volume
    std::vector<std::string> warnings;
};

/// Throws InvalidInput, naming the word, where size, mode, axes or NSYMBT of a header are impossible.
void check_mrc_header(const MrcHeader& header, const std::string& file);

/// The layout of a file with this header. `length`: of the file in bytes, where it is known; `bound`: no more
/// bytes than this can come. Throws InvalidInput where the file is too short for what the header promises, or
/// the header cannot be made sense of.
MrcLayout lay_out(const MrcHeader& header, const MrcReadOptions& options, const std::string& file,
                  std::optional<std::uint64_t> length, std::uint64_t bound);

/// 1024, the extended header, and the data of all sections; the largest number where that overflows.
std::uint64_t promised_bytes(const MrcHeader& header);

/// Matrix of a cell's unit vectors (columns): a along x, b in the xy plane, as in PDB files. Nothing where
/// the angles (degrees) make no cell.
std::optional<Mat3d> cell_directions(const Vec3d& angles);

}  // namespace vdbgeo
