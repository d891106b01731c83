// A mesh made ready for rays: centred, scaled, with vertex normals. Used by render only.
#pragma once

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/view/layout.h"

namespace vdbgeo {

/// The mesh moved into the unit ball about the origin, with vertex normals.
struct ViewModel {
    Vec3d centre;
    double radius = 0;  // Å a unit
    Array<Vec3f> points, normals;
    const Array<Triangle>* triangles = nullptr;
};

/// InvalidInput where all points coincide. Points that no face uses are left out of centre and radius.
ViewModel make_view_model(const TriMesh& mesh);

/// The model's box in a view's axes, relative to its centre.
ViewBox box_in_view(const ViewModel& model, const View& view);

}  // namespace vdbgeo
