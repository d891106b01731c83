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
    double area_A2 = 0;                 ///< without caps
    std::optional<double> volume_A3;    ///< closed, oriented pieces: positive for shells, negative for cavities
    bool touches_border = false;        ///< has boundary edges or caps
    Vec3d centroid = Vec3d::Zero();     ///< of the area
    /// A closed piece turned inward is a cavity.
    bool cavity() const { return volume_A3 && *volume_A3 < 0; }
};

/// Pieces are connected through edges and vertices; the largest area first, then the lowest face.
struct MeshComponents {
    std::vector<MeshComponent> components;
    std::vector<std::uint32_t> of_face;  ///< the component of each face
};

MeshComponents mesh_components(const TriMesh& mesh, const Progress& progress = {});

/// What to keep. Neutral as it is made. Volumes and areas are those of a piece itself.
struct ComponentFilter {
    std::optional<std::uint64_t> keep_largest;  ///< this many shells, by area; their cavities stay with them
    double min_volume_A3 = 0;                   ///< pieces of less |volume| go; open ones stay
    double min_area_A2 = 0;
    bool drop_border = false;    ///< pieces that touch the border go
    bool drop_cavities = false;  ///< pieces that are turned inward go

    void check() const;
};

/// The faces whose component is in `keep` (one flag a component), with their vertices and properties, in order.
TriMesh extract_components(const TriMesh& mesh, const MeshComponents& components, const std::vector<bool>& keep);

TriMesh filter_components(const TriMesh& mesh, const ComponentFilter& filter, const Progress& progress = {});

}  // namespace vdbgeo
