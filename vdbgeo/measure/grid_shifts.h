// Where the vertices of a surface cut from a grid ought to be.
#pragma once

#include "vdbgeo/measure/fit_surface.h"
#include "vdbgeo/measure/sampling_lattice.h"

namespace vdbgeo {

/// Marching cubes puts a vertex where the straight line between two samples crosses the level. The function
/// f itself crosses elsewhere: the vertex is −½ t(1−t) h² f_aa/|∇f| off along the normal, where a is the
/// edge's axis, h its length and t the fraction of it. f_aa/|∇f| is S_aa + ν n_a²: S the shape operator of
/// the surface, ν the one number of f that the surface does not tell. Both come out of one linear fit of a
/// quadric with that term to the vertices within 2.5 steps; ν is held towards its median over the mesh. What
/// is left of the error is of the next order: on a sphere cut from its distance map 1/130.
///
/// Returns the shifts that undo this, zero where nothing fits. 4 µs a vertex.
Array<Vec3f> interpolation_shifts(const FitSurface& surface, const SamplingLattice& lattice);

/// Whether the mesh joins the outermost nodes of a mask: all vertices on nodes, edges along the axes, and
/// faces that are not all across an axis, as the sides of voxels are.
bool joins_nodes(const TriMesh& mesh, const SamplingLattice& lattice);

/// The last node inside a mask lies between nothing and one step max|n_a| inside its boundary: half of that
/// outward, with the normal n of a fit over four steps.
Array<Vec3f> mask_shifts(const FitSurface& surface, const SamplingLattice& lattice);

}  // namespace vdbgeo
