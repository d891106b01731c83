// Pictures of tetrahedral meshes that were cut open: shared by cutaway and render.
#pragma once

#include <string>

#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/tet/cutaway.h"
#include "vdbgeo/view/render.h"

namespace vdbgeo::app {

/// The normal of a plane across an axis, "x", "y" or "z": it takes away what is before it in the views side,
/// front and top. Zero for another text.
Vec3d normal_across(const std::string& axis);

/// A plane at a part of the mesh's extent along its normal: 0 nothing is left, 1 all.
CutawayOptions::Plane plane_at(const TetMesh& mesh, const Vec3d& normal, double part, bool whole_tets);

/// Towards a viewer who looks into the opening, a little from the right and from above, as an option of
/// render; "iso" where nothing is open.
std::string view_onto(const TriMesh& opened);

/// Colours by a property of the tetrahedra, on scales that are the same from picture to picture: angles to
/// that of the regular tetrahedron.
void set_cut_colours(RenderOptions& render, const std::string& property);

/// The mesh as it is shown: faces that were cut open have colours by the property, the old boundary has none.
TriMesh shown_cut(TriMesh opened, const std::string& property);

}  // namespace vdbgeo::app
