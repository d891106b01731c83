// The surface of a trilinear interpolant inside one cell: which of its edges' crossings are joined to what.
// Shared by marching cubes and its tests; users want marching_cubes.h.
#pragma once

#include <array>
#include <cstdint>

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
constexpr int max_triangles = 24, max_centres = 4;

/// How to triangulate a cell: triples of vertices, 0…11 the crossing of that edge, 12 + k the k-th extra
/// vertex inside the cell. That lies midway between the mean of the crossings in `centre_edges[k]` (a bit per
/// edge) and the mean of those in `around_edges[k]`.
struct Pattern {
    std::uint8_t triangle_count = 0, centre_count = 0;
    std::array<std::uint16_t, max_centres> centre_edges{}, around_edges{};
    std::array<std::array<std::uint8_t, 3>, max_triangles> triangles{};
};

/// The patterns of the 256 sign cases (bit c set: corner c is inside) that depend on the case alone: those
/// without an ambiguous face and with a single loop. Null for the others.
const std::array<const Pattern*, 256>& fixed_patterns();

/// The pattern with the topology of the trilinear interpolant, for any case. `d` are the corner values minus
/// the isovalue; corners with d ≥ 0 are inside. Ambiguous faces are told apart by the asymptotic decider
/// (Nielson & Hamann 1991), which depends on the four values of the face alone, so that the two cells at a
/// face agree; the inside by following the level set of the slices z = t from t = 0 to 1, whose only events
/// are the crossings of the z edges and the zeros of a quadratic: exact, in place of the case-by-case tests
/// of Chernyaev (1995).
const Pattern& pattern(int sign_case, const std::array<double, corners>& d);

}  // namespace vdbgeo::cell
