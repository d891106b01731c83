// A closed surface made ready for the tetrahedralizers that fill one: checked, with its regions told apart.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct SolidInput {
    /// A connected solid: a shell and the cavities in it. Those of a label are together one region.
    struct Region {
        std::int32_t region = 1;
        Vec3d inside = Vec3d::Zero();  ///< a point of it, well away from the surface
        double volume_A3 = 0;
    };
    static constexpr std::int32_t outside = -1;

    /// The surface's own, in its order; those with the same coordinates are one, unused ones are left out.
    Array<Vec3d> points;
    Array<Triangle> triangles;  ///< each once; between two solids one of the two
    /// The places in `regions` of the solids behind and before each triangle; the latter may be `outside`.
    Array<std::array<std::int32_t, 2>> solids;
    std::vector<Region> regions;
    std::vector<Vec3d> holes;  ///< a point in each space that is enclosed and in no solid
};

/// The solids that a surface bounds. Every closed piece turned outward is a shell of a region of its own,
/// numbered from 1 by area, the largest first; pieces turned inward are cavities of the shell around them,
/// and a shell in a cavity is a region again. With the face property `label` (command surface --labels) the
/// regions are the labels, and the solids are in the order of the labels. Where two solids have faces on the
/// same three points the two become one; surfaces may also touch along vertices and edges of the same
/// coordinates.
///
/// Throws InvalidInput, beginning with `stage`, for what cannot be filled: no faces, coordinates that are not
/// finite, an open or a non-manifold surface, faces that run against each other, pieces that are turned
/// inward without a shell around them ("inside out; try repair"), solids in solids, pieces too
/// thin for a point within (some units in the last place), faces without area, faces that cut or touch each
/// other (with how many pairs and one of them; try repair; not looked for where this build has no CGAL),
/// labels that are no whole numbers from 1 on. Cost: that of self_intersections, and about 2 µs a face.
SolidInput solid_input(const TriMesh& surface, const std::string& stage, const Progress& progress = {});

}  // namespace vdbgeo
