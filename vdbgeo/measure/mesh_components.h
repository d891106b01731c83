// The connected pieces of a mesh: which are shells, which are cavities, which are dust.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct MeshComponent {
    std::uint64_t vertices = 0, faces = 0;
    double area_A2 = 0;               ///< without caps
    std::optional<double> volume_A3;  ///< closed, oriented pieces: positive for shells, negative for cavities
    bool touches_border = false;      ///< has boundary edges or caps
    /// Of the area without caps; of the faces' corners where there is no such area.
    Vec3d centroid = Vec3d::Zero();
    /// A closed piece turned inward is a cavity.
    bool cavity() const { return volume_A3 && *volume_A3 < 0; }
};

/// Pieces are connected through edges and vertices; the largest area first, then the lowest face.
struct MeshComponents {
    std::vector<MeshComponent> components;
    std::vector<std::uint32_t> of_face;  ///< the component of each face
};

/// The pieces of a mesh. Closed means that every edge of a piece has two faces, oriented that they run
/// through it in opposite directions. Degenerate faces (a vertex twice) connect nothing and have no sides:
/// they belong to the piece of their first vertex. Vertices that no face uses belong to no piece.
///
/// Throws InvalidInput for a mesh that check() refuses. Cost: O(n), and 30 bytes a face; 150 bytes a piece.
MeshComponents mesh_components(const TriMesh& mesh, const Progress& progress = {});

/// For each piece that is a cavity: the piece that bounds the same solid from outside. Found by a ray along
/// +x from the cavity's highest vertex in x: the first surface it leaves the solid through is that piece, or
/// another cavity in the same solid. Unset for all other pieces, and for cavities that no surface is outside
/// of.
std::vector<std::optional<std::uint32_t>> shells_of_cavities(const TriMesh& mesh,
                                                             const MeshComponents& components);

/// What to keep. Neutral as it is made. Volumes and areas are those of a piece itself.
struct ComponentFilter {
    /// This many shells, the largest by area of those that the other conditions leave; open pieces are
    /// shells, and so is a cavity that no shell is around.
    std::optional<std::uint64_t> keep_largest;
    double min_volume_A3 = 0;    ///< pieces of less |volume| go; open ones stay
    double min_area_A2 = 0;      ///< pieces of less area (caps not counted) go
    bool drop_border = false;    ///< pieces that touch the border go
    bool drop_cavities = false;  ///< pieces that are turned inward go

    /// Throws InvalidInput for keep_largest 0 and bounds that are negative or not finite.
    void check() const;
};

/// The faces whose component is in `keep` (one flag a component), with their vertices and properties, in
/// order. Vertices that no kept face uses are left out.
TriMesh extract_components(const TriMesh& mesh, const MeshComponents& components,
                           const std::vector<bool>& keep);

/// The pieces that the filter keeps. The cavities of a shell go where it goes. Where all stay, the mesh comes
/// back as it is, with its unused vertices.
TriMesh filter_components(const TriMesh& mesh, const ComponentFilter& filter, const Progress& progress = {});

}  // namespace vdbgeo
