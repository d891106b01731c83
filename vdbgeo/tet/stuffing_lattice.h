// The lattice that isosurface stuffing fills space with, and how its points are kept: blocks of bits. For
// isosurface_stuffing; nothing outside this folder needs it.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "vdbgeo/surface/trilinear_field.h"

namespace vdbgeo::stuffing {

using openvdb::Coord;

/// The lattice is body-centred cubic. Slot (x, y, z) is the cube from corner (x, y, z) to (x+1, y+1, z+1) in
/// units of the cell; it owns that lower corner and its centre. Cubes lie in blocks of 8³.
constexpr int dim = 8;
enum Kind : int { corner = 0, centre = 1 };

/// Edges of the lattice by the slot that owns them: 0…2 from a corner one step up along an axis, 3…5 from a
/// centre likewise (these six are long: length 1), 6…13 from a centre to the corner of its cube that is up
/// along the axes of the bits of class − 6 (short: length √3/2).
constexpr int edge_classes = 14;
constexpr bool is_long(int edge_class) { return edge_class < 6; }

/// A bit for each slot of a block: bit 8·y + z of word x.
using Bits = std::array<std::uint64_t, dim>;
constexpr int bit_of(int y, int z) { return 8 * y + z; }
inline bool test(const Bits& bits, int x, int y, int z) {
    return bits[static_cast<std::size_t>(x)] >> bit_of(y, z) & 1;
}
inline bool any(const Bits& bits) {
    std::uint64_t sum = 0;
    for (const std::uint64_t w : bits) sum |= w;
    return sum != 0;
}
inline std::uint64_t row_of(const Bits& bits, int x, int y) {
    return bits[static_cast<std::size_t>(x)] >> 8 * y & 0xFF;
}

/// How many bits are set; in place, since the compiler calls a function for it where it may not take for
/// granted that the CPU can count.
inline int count_bits(std::uint64_t v) {
    v -= v >> 1 & 0x5555555555555555ull;
    v = (v & 0x3333333333333333ull) + (v >> 2 & 0x3333333333333333ull);
    return static_cast<int>(((v + (v >> 4)) & 0x0F0F0F0F0F0F0F0Full) * 0x0101010101010101ull >> 56);
}

/// Bits that know how many are set before each.
struct RankedBits {
    Bits bits{};
    std::array<std::uint16_t, dim> before{};

    /// Counts on from `first`; returns how many there are then.
    int rank_from(int first) {
        for (std::size_t x = 0; x < bits.size(); ++x) {
            before[x] = static_cast<std::uint16_t>(first);
            first += count_bits(bits[x]);
        }
        return first;
    }
    int rank(int x, int y, int z) const {
        const std::uint64_t below = (std::uint64_t{1} << bit_of(y, z)) - 1;
        const auto w = static_cast<std::size_t>(x);
        return before[w] + count_bits(bits[w] & below);
    }
};

/// Calls f(x, y, z) for each bit that is set, in order.
template <class F>
void for_each_bit(const Bits& bits, const F& f) {
    for (int x = 0; x < dim; ++x)
        for (std::uint64_t w = bits[static_cast<std::size_t>(x)]; w; w &= w - 1) {
            const int b = __builtin_ctzll(w);
            f(x, b >> 3, b & 7);
        }
}

/// The bits of a block and of one layer of slots around it.
struct Halo {
    /// Row (x, y), each −1…8; bit z + 1.
    std::uint16_t rows[dim + 2][dim + 2];

    std::uint16_t& row(int x, int y) { return rows[x + 1][y + 1]; }
    std::uint16_t row(int x, int y) const { return rows[x + 1][y + 1]; }
    bool at(int x, int y, int z) const { return row(x, y) >> (z + 1) & 1; }
    /// Bit z is slot (x, y, z + step).
    std::uint64_t row8(int x, int y, int step = 0) const {
        return static_cast<std::uint64_t>(row(x, y) >> (1 + step) & 0xFF);
    }
};

/// Morton codes of blocks: their order, and their names in the hash. 21 bits an axis.
constexpr int key_bits = 21, key_bias = 1 << (key_bits - 1);
std::uint64_t key_of(const Coord& block);
Coord block_of(std::uint64_t key);

/// Where the lattice lies in the world and in the map, and which side of the surface its points are on. The
/// lattice's (0, 0, 0) is the map's first sample; its axes are the world's.
class Lattice {
 public:
    /// `cell` in voxels.
    Lattice(const DensityMap& map, double isovalue, double cell);

    double cell() const { return cell_; }  ///< Å
    Vec3d to_world(const Vec3d& lattice) const { return origin_ + cell_ * lattice; }
    Vec3d to_index(const Vec3d& lattice) const { return to_index_ * lattice; }
    const Mat3d& from_index() const { return from_index_; }

    /// Above or equal 0 inside. Where an unbounded grid's background is inside, everything is turned over,
    /// and the solid is the rest.
    double operator()(const Vec3d& lattice) const {
        TrilinearField::Cursor cursor;
        return (*this)(lattice, cursor);
    }
    double operator()(const Vec3d& lattice, TrilinearField::Cursor& cursor) const {
        const double v = field_(to_index_ * lattice, cursor);
        if (!turned_) return v;
        return v >= 0 ? -std::max(v, std::numeric_limits<double>::min()) : -v;
    }
    bool inside(const Vec3d& lattice) const { return (*this)(lattice) >= 0; }
    bool inside(const Vec3d& lattice, TrilinearField::Cursor& cursor) const {
        return (*this)(lattice, cursor) >= 0;
    }

    /// Where the field is 0 on the way from `in` (inside) to `out` (outside), as a fraction of it.
    double root(const Vec3d& in, const Vec3d& out) const;

 private:
    double leave_box(const Vec3d& in, const Vec3d& step) const;

    TrilinearField field_;
    bool bounded_, turned_;
    Vec3d last_;  // index of the last sample
    double cell_;
    Vec3d origin_;
    Mat3d to_index_, from_index_;
};

}  // namespace vdbgeo::stuffing
