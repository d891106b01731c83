// Which points of the lattice are inside, where the surface cuts its edges, and which points are snapped to
// it. For isosurface_stuffing; nothing outside this folder needs it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vdbgeo/tet/stuffing_blocks.h"

namespace vdbgeo::stuffing {

/// A cut point nearer to an end of its edge than this part of the edge is too near.
constexpr double alpha_long = 0.27, alpha_short = 0.4;

/// A point of the lattice that was moved onto the surface.
struct Snap {
    std::uint16_t slot = 0;  ///< 512·kind + 64·x + 8·y + z
    std::uint8_t edge = 0;   ///< which of incident_edges
    double part = 0;         ///< how far along it
};

/// A block with ends of crossed edges.
struct SurfaceBlock {
    std::size_t block = 0;
    std::array<Bits, 2> critical{};            ///< points with a crossed edge, before any was snapped
    std::array<RankedBits, edge_classes> cut;  ///< edges with a cut point, at last those that remain
    std::vector<double> parts;                 ///< where, from the owner's end, in the order of `cut`
    std::array<Bits, 2> zero{};                ///< points that were snapped
    std::vector<Snap> snaps;                   ///< by slot
};

/// One of the 14 edges at a point of the lattice, as offsets of slots from the point's own.
struct IncidentEdge {
    Kind other;              ///< of the point at the other end
    std::array<int, 3> far;  ///< slot of that point
    std::array<int, 3> owner;
    int edge_class;
    bool first;       ///< whether the point is the end that owns the edge
    Vec3d direction;  ///< to the other end
};
const std::array<IncidentEdge, 14>& incident_edges(Kind kind);

/// The bits of block b and around it; bits_of(block number or -1) → Bits.
template <class BitsOf>
Halo make_halo(const BlockTable& table, std::size_t b, const BitsOf& bits_of) {
    std::array<Bits, 27> around;
    for (std::size_t k = 0; k < around.size(); ++k) around[k] = bits_of(table[b].around[k]);
    Halo out;
    for (int x = -1; x <= dim; ++x)
        for (int y = -1; y <= dim; ++y) {
            const auto row = [&](int z) { return row_of(around[side_of(x, y, z)], x & 7, y & 7); };
            out.row(x, y) = static_cast<std::uint16_t>(row(-1) >> 7 | row(0) << 1 | (row(dim) & 1) << 9);
        }
    return out;
}

/// The lattice with its signs. Points of blocks that are not in the table are outside, of those without a
/// surface block on one side.
class SnappedLattice {
 public:
    SnappedLattice(const Lattice& lattice, const std::vector<MarkedBlock>& marked, const BlockTable& table,
                   const Progress& progress);

    const BlockTable& table() const { return table_; }
    /// The surface block of block b, or null.
    const SurfaceBlock* surface(std::int32_t b) const {
        const std::int32_t s = b < 0 ? -1 : surface_of_[static_cast<std::size_t>(b)];
        return s < 0 ? nullptr : &surfaces_[static_cast<std::size_t>(s)];
    }
    /// Whether all points of block b are inside, and none is on a crossed edge.
    bool full(std::int32_t b) const { return b >= 0 && constant_[static_cast<std::size_t>(b)] == all_in; }

    /// Inside and not snapped.
    Halo plus(std::size_t b, Kind kind) const;
    Halo zero(std::size_t b, Kind kind) const;
    Halo critical(std::size_t b, Kind kind) const;

 private:
    enum Constant : std::uint8_t { mixed, all_in, all_out };
    static constexpr std::uint8_t undecided = 0, snapped = 1, kept = 2;

    void sample(const Lattice& lattice, const std::vector<MarkedBlock>& marked);
    void find_surfaces();
    void find_cuts(SurfaceBlock& s, const Lattice& lattice) const;
    void snap(const Progress& progress);
    std::uint8_t judge(const SurfaceBlock& s, int slot, Snap* best) const;
    void finish_snaps();
    void remove_dead_cuts(SurfaceBlock& s) const;
    std::uint8_t state(std::int32_t block, Kind kind, int x, int y, int z) const;

    const BlockTable& table_;
    std::vector<std::array<Bits, 2>> inside_;  // of marked blocks
    std::vector<std::uint8_t> constant_;       // of blocks
    std::vector<std::int32_t> surface_of_;     // of blocks
    std::vector<SurfaceBlock> surfaces_;
    std::vector<std::vector<std::uint8_t>> state_;  // of surface blocks' points while they are decided
};

}  // namespace vdbgeo::stuffing
