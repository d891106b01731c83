// The last step of remeshing: the few bad angles that are left, one by one.
#pragma once

#include "vdbgeo/remesh/remesh_state.h"

namespace vdbgeo {

/// Goes through the faces with an angle below `least_deg`, the worst first, and makes of each the best change
/// there is: one of its corners moved on the input, a side flipped, collapsed, or split. A change is made
/// only where the least angle of all faces it touches becomes larger, so that the mesh's least angle never
/// falls.
void polish_angles(RemeshState& state, double least_deg);

}  // namespace vdbgeo
