// A closed surface made ready for the tetrahedralizers that fill one: checked, with its regions told apart.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

struct SolidInput {
    struct Region {
        std::int32_t region = 1;
        Vec3d inside = Vec3d::Zero();  ///< a point of it, well away from the surface
    };
    Array<Vec3d> points;        ///< the surface's own, in its order; those with the same coordinates are one
    Array<Triangle> triangles;  ///< each once; between two labels one of the two
    std::vector<Region> regions;
    std::vector<Vec3d> holes;  ///< a point in each cavity
};

/// The solids that a surface bounds. Every closed piece turned outward is a shell of a region of its own,
/// numbered from 1 by area, the largest first; pieces turned inward are cavities of the shell around them, and
/// a shell in a cavity is a region again. With the face property `label` (command surface --labels) the
/// regions are the labels; faces of two labels on the same three points become one.
///
/// Throws InvalidInput, beginning with `stage`, for what cannot be filled: no faces, coordinates that are not
/// finite, an open or a non-manifold surface, faces that run against each other, pieces that are turned inward
/// without a shell around them ("inside out; try repair"), faces without area, faces that cut or touch each
/// other (with how many pairs and one of them; try repair). Cost: that of self_intersections.
SolidInput solid_input(const TriMesh& surface, const std::string& stage, const Progress& progress = {});

}  // namespace vdbgeo
