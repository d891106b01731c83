// The surface of a trilinear interpolant inside one cell: which of its edges' crossings are joined to what.
// Shared by marching cubes and its tests; users want marching_cubes.h.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace vdbgeo::cell {

// Corner c lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Edge 4·a + b runs along axis a; the two bits of b are its
// places on the other two axes, in the order x, y, z. Face 2·a + s lies across axis a at place s.
constexpr int corners = 8, edges = 12, faces = 6;

/// The corner of edge e with the lower coordinate; the other is 1 << (e / 4) further.
constexpr int lower_corner(int e) {
    constexpr int first[3][4] = {{0, 2, 4, 6}, {0, 1, 4, 5}, {0, 1, 2, 3}};
    return first[e / 4][e % 4];
}
constexpr int upper_corner(int e) { return lower_corner(e) + (1 << (e / 4)); }

/// Most triangles and extra vertices that a cell can need.
constexpr int max_triangles = 24, max_centres = 6;

/// A tunnel: the two loops that it joins, the shorter first. Where both have crossings in one face, a ring of
/// extra vertices runs between them, one for each crossing of the first.
struct Tunnel {
    std::array<std::uint8_t, 2> size{};
    std::array<std::array<std::uint8_t, edges>, 2> loop{};
    bool ring = false;
    std::uint8_t first_centre = 0, first_triangle = 0;
};

/// How to triangulate a cell: triples of vertices, 0…11 the crossing of that edge, 12 + k the k-th extra
/// vertex inside the cell. That is the mean of the crossings in `centre_edges[k]` (a bit per edge). A
/// tunnel's triangles and extra vertices are counted, but depend on the crossings' places: cell_tunnel.h.
struct Pattern {
    std::uint8_t triangle_count = 0, centre_count = 0;
    std::array<std::uint16_t, max_centres> centre_edges{};
    std::array<std::array<std::uint8_t, 3>, max_triangles> triangles{};
    Tunnel tunnel;

    bool has_tunnel() const { return tunnel.size[0] > 0; }
};

/// Number of a pattern in the table; with the bit `unsettled` the one without a tunnel, where the corner
/// values tell whether there is one.
using PatternId = std::uint16_t;
constexpr PatternId unsettled = 0x8000, no_pattern = 0xFFFF;

/// For a pattern without a tunnel the ones that have it. Two loops are joined by a tunnel where the level set
/// of a slice z = t changes from one pair of arcs to the other. It can while the slice's corners alternate in
/// sign: the first pattern is that of a change while its corners (0, 0) and (1, 1) are inside, the second
/// that of a change while the other two are; no_pattern where neither would join loops.
using TunnelPatterns = std::array<PatternId, 2>;

/// All patterns, and which of them a cell has.
struct PatternTable {
    std::vector<Pattern> patterns;
    std::vector<TunnelPatterns> tunnels;  ///< of each pattern
    /// By the cell's key: bit c, corner c is inside; bit 8 + f, the inside corners of face f are joined
    /// across it. The latter counts where the face is ambiguous (inside corners at both ends of one diagonal
    /// alone) and is ignored elsewhere.
    std::array<PatternId, 1 << (corners + faces)> of_key;
};
const PatternTable& pattern_table();

/// Whether the inside corners of an ambiguous face are joined: by the asymptotic decider (Nielson & Hamann
/// 1991), which depends on the four values of the face alone, so that the two cells at a face agree. Values
/// minus the isovalue: of the ends of the diagonal that is inside, and of the other's.
inline bool joined_across_face(double inside_a, double inside_b, double outside_a, double outside_b) {
    return inside_a * inside_b >= outside_a * outside_b;
}

}  // namespace vdbgeo::cell
