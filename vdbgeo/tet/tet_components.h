// The connected pieces of a tetrahedral mesh, and which of them are kept.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo {

struct TetComponent {
    std::uint64_t tets = 0;
    double volume_A3 = 0;
};

/// Pieces are connected through faces, whatever the regions; the largest volume first, then the lowest
/// tetrahedron.
struct TetComponents {
    std::vector<TetComponent> components;
    Array<std::uint32_t> of_tet;  ///< the component of each tetrahedron
};

/// Throws InvalidInput as tet_adjacency does. Cost: that of tet_adjacency, and 4 bytes a tetrahedron.
TetComponents tet_components(const TetMesh& mesh);

/// What to keep. Neutral as it is made.
struct TetComponentFilter {
    std::optional<std::uint64_t> keep_largest;  ///< this many, by volume
    double min_volume_A3 = 0;

    bool any() const { return keep_largest || min_volume_A3 > 0; }
    /// Throws InvalidInput for keep_largest 0 and a volume that is negative or not finite.
    void check() const;
};

/// The pieces that the filter keeps, with their vertices, regions and properties, in order; faces are set
/// anew. Where all stay the mesh comes back as it is.
TetMesh filter_tet_components(TetMesh mesh, const TetComponentFilter& filter);

}  // namespace vdbgeo
