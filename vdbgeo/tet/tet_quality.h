// How good the tetrahedra of a mesh are.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo {

/// The numbers of one tetrahedron. A flat or turned-over one has volume ≤ 0, and angles as its faces lie.
struct TetShape {
    double volume = 0;                              ///< signed, Å³
    std::array<double, 6> dihedral_deg{};           ///< at the edges of tet_edges
    double min_dihedral_deg = 0, max_dihedral_deg = 0;
    /// Circumradius over shortest edge: √6/4 = 0.612 for the regular one, ∞ for a flat one.
    double radius_edge = 0;
};

TetShape tet_shape(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d);

/// One region of a mesh.
struct TetRegion {
    std::int32_t region = 1;
    std::uint64_t tets = 0;
    double volume_A3 = 0;
};

struct TetQuality {
    static constexpr int radius_edge_bins = 100;  ///< of 0.05, the last one open
    static constexpr double sliver_deg = 5;

    std::uint64_t vertices = 0, tets = 0;
    std::uint64_t boundary_faces = 0;
    std::uint64_t inverted = 0;  ///< of no or negative volume
    std::uint64_t slivers = 0;   ///< with a dihedral angle below 5° or above 175°
    double volume_A3 = 0;
    double min_volume_A3 = 0, max_volume_A3 = 0;  ///< of a tetrahedron
    double min_dihedral_deg = 0, max_dihedral_deg = 0, mean_min_dihedral_deg = 0;
    double min_dihedral_p01_deg = 0;  ///< of the tetrahedra's smallest angles, 1 % are below
    double radius_edge_max = 0, radius_edge_mean = 0;
    double mean_edge_A = 0, min_edge_A = 0, max_edge_A = 0;
    std::vector<TetRegion> regions;                   ///< by number
    std::array<std::uint64_t, 180> dihedral_histogram{};  ///< all six angles of each, by whole degrees
    std::array<std::uint64_t, radius_edge_bins> radius_edge_histogram{};
};

/// Shapes of all tetrahedra. Neutral for an empty mesh (all 0). Cost: 0.1 µs a tetrahedron; sums in a fixed
/// order. Throws InvalidInput for a mesh that check() refuses.
TetQuality measure_tets(const TetMesh& mesh, const Progress& progress = {});

/// Sets the tet properties min_dihedral_deg, max_dihedral_deg, radius_edge and volume_A3.
void set_quality_properties(TetMesh& mesh);

}  // namespace vdbgeo
