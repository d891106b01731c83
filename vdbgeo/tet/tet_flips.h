// Flips that raise the worst dihedral angle of a few tetrahedra that lie together. For tet_optimize.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/tet/tet_store.h"

namespace vdbgeo {

/// Tetrahedra `old` and others that fill the same space better.
struct TetFlip {
    std::vector<std::uint32_t> old;
    std::vector<Tetrahedron> fresh;
    double before = 0, after = 0;  ///< the least worth of the old and of the fresh ones
};

/// Takes an edge away: the n tetrahedra around it become 2(n − 2) on the best triangulation of the polygon of
/// the vertices around (3-2 and 4-4 flips are n = 3 and 4), found by Klincsek's dynamic programme (1980,
/// doi:10.1016/S0167-5060(08)70044-X). Nothing for an edge on the boundary or between regions, with more than
/// 7 tetrahedra, and where no triangulation is better than what is there.
std::optional<TetFlip> edge_removal(const TetStore& store, std::uint32_t tet, std::size_t edge);

/// Takes the face opposite corner k of a tetrahedron away: two tetrahedra become three (2-3 flip). Nothing
/// for faces on the boundary or between regions, and where that is not better.
std::optional<TetFlip> face_removal(const TetStore& store, std::uint32_t tet, std::size_t k);

/// Does the best flip of each of the tetrahedra `bad` that is better than what is there by at least a little:
/// flips are looked for in parallel, and done by falling gain (then by number) where none of their tetrahedra
/// was flipped in this call. `tried` as in move_vertices, by tetrahedron. Returns how many flips were done.
std::uint64_t flip_tets(TetStore& store, const std::vector<std::uint32_t>& bad,
                        std::vector<std::uint32_t>& tried, std::uint32_t& epoch);

}  // namespace vdbgeo
