// Which samples of a map stay: the step from samples as they come to the leaves of a sparse grid.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/leaf_layout.h"
#include "vdbgeo/volume/rounding.h"

namespace vdbgeo {

/// Which samples a sparse grid keeps. With neither field set every sample is kept, and going back to a dense
/// file gives the same bits.
struct SparsifyOptions {
    /// Keep samples above this value; the rest reads as the background, and so does what is not finite.
    std::optional<float> threshold;
    /// Keep samples within `band` of `threshold` (which is then the isovalue). What lies above the band is
    /// not active and reads as the band's upper end, so the surface at the isovalue is unchanged.
    std::optional<float> band;
    /// The value of what was dropped: the solvent level, not above the threshold. Unset: the median over the
    /// faces of the box (of about a million of their samples, where there are more), but not above the
    /// threshold (or the band's lower end).
    std::optional<float> background;
    /// Round what is kept to multiples of this power of two (quantisation_step): the zeros at the end of the
    /// values are what compression finds. Thresholds apply to the values before.
    std::optional<float> quantisation;

    /// Throws InvalidInput when the fields contradict each other.
    void check() const;
};

/// A row of blocks as its samples come: up to eight sections of up to eight rows, with all columns. Either as
/// floats or as integers of 16 bits, which stand for sign · (integer + bias).
struct Strip {
    const float* floats = nullptr;
    const std::int16_t* integers = nullptr;
    int bias = 0, sign = 1;
    std::size_t row_stride = 0, section_stride = 0;  ///< in samples
    int columns = 0, rows = 0, sections = 0;

    /// One row as floats.
    void copy_row(int section, int row, float* out) const;
};

/// Count, mean and squared deviations of a set of samples; sets join by Chan, Golub and LeVeque's update
/// (1983), so that a large mean costs no accuracy. What is not finite is counted apart.
struct Moments {
    std::uint64_t count = 0, non_finite = 0;
    double mean = 0, squares = 0;
    float min = std::numeric_limits<float>::infinity(), max = -std::numeric_limits<float>::infinity();

    void join(const Moments& other);
    Statistics statistics() const;
};

/// What one block of 8³ samples becomes: a leaf, or a tile of one value. The inactive values of a leaf are
/// `unknown_background`, or the upper end of the band.
struct SortedBlock {
    enum class Tile { none, kept, above };

    openvdb::Coord origin;
    std::unique_ptr<leaf::Leaf> leaf;
    Tile tile = Tile::none;
    float tile_value = 0;
};

/// What a strip holds: the blocks of which anything stays, in the order of the columns.
struct SortedStrip {
    Moments moments;
    std::vector<SortedBlock> blocks;
    std::vector<float> border;  ///< samples on the faces of the box
    RoundingError rounding;     ///< of the quantisation
};

/// Sorts strips into blocks. `sort` may be called from many threads; what it gives depends on the strip
/// alone.
///
/// Strips are numbered by their place: `slab` counts eight sections each, `row` eight rows. Cost: one read of
/// the samples (16-bit integers eight at a time), and a copy of what stays.
class StripSorter {
 public:
    /// Stands for the background, which is known only when the last border sample was seen.
    static constexpr float unknown_background = -std::numeric_limits<float>::infinity();

    /// `size`: samples along x, y, z. `order[0]` is the axis (0 x, 1 y, 2 z) of the columns, [1] of the rows,
    /// [2] of the sections. `keep`: where given, its active voxels are kept, and the threshold says nothing
    /// but what the background may be; it has to outlive the sorter.
    StripSorter(const Vec3i& size, const std::array<int, 3>& order, const SparsifyOptions& options,
                const openvdb::MaskTree* keep = nullptr);

    SortedStrip sort(const Strip& strip, int slab, int row) const;

    const Vec3i& size() const { return size_; }
    const std::array<int, 3>& order() const { return order_; }
    const SparsifyOptions& options() const { return options_; }
    int slabs() const { return (size_[order_[2]] - 1) / leaf::dim + 1; }
    int strips_in_slab() const { return (size_[order_[1]] - 1) / leaf::dim + 1; }
    /// Upper end of the band; infinite without one.
    float upper_end() const;
    /// Samples above this are kept.
    float lower_end() const;

 private:
    struct Block;
    void sample_border(const Strip& strip, int slab, int row, std::vector<float>& out) const;
    bool nothing_stays(const Moments& moments, const openvdb::Coord& origin) const;
    void load(const Strip& strip, int column, Block& block) const;
    void decide(const Block& block, const Moments& moments, SortedBlock& result) const;
    bool mark_kept(const Block& block, SortedBlock& result) const;
    bool mark_above(const Block& block, leaf::Leaf& leaf) const;
    RoundingError round(SortedBlock& block) const;

    Vec3i size_;
    std::array<int, 3> order_;
    SparsifyOptions options_;
    const openvdb::MaskTree* keep_;
    std::uint64_t border_step_ = 1;
};

/// What is gathered over all strips of a map, which have to be added in file order.
class MapTotals {
 public:
    void add(const SortedStrip& strip);
    Statistics statistics() const { return moments_.statistics(); }
    /// The value of what was dropped, as SparsifyOptions::background tells. Call it once, last.
    float background(const StripSorter& sorter);
    const RoundingError& rounding() const { return rounding_; }

 private:
    Moments moments_;
    std::vector<float> border_;
    RoundingError rounding_;
};

}  // namespace vdbgeo
