// Fewer faces by quadric edge collapses.
#pragma once

#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// At least one of the two; with both, whichever is reached first ends it.
struct SimplifyOptions {
    std::optional<std::uint64_t> faces;  ///< stop at this many faces (or one fewer)
    std::optional<double> max_distance;  ///< Å: two-sided Hausdorff distance to the input stays within it

    /// Throws InvalidInput where neither is set, and for a distance that is not a finite number above 0.
    void check() const;
};

/// Collapses edges, the cheapest first, to the point of least Σ area·(distance to the planes of the faces
/// that the edge has come to stand for)² (Garland & Heckbert 1997, doi:10.1145/258734.258849), with a pull of
/// a thousandth towards the vertices' places, which rounds the triangles and settles what flat places leave
/// open. Edges come from a queue in which costs count to a quarter of an octave; the order, and so the
/// result, is the same for any number of threads.
///
/// The mesh has to be an oriented manifold, open or closed; anything else is refused (InvalidInput, "simplify
/// needs a manifold mesh: …; try repair"). It stays one, with its components, its genus and its borders (the
/// link condition): a component never gets smaller than a tetrahedron, a border than a triangle, and where
/// nothing more can go the result has more faces than were asked for. No face turns by more than 78 degrees
/// in one collapse. Borders and the rims of caps (face property "cap") collapse along themselves only. Faces
/// keep their properties; a vertex has those of the end of the edge that was nearer. Points that no face
/// names are dropped. A mesh that has few enough faces comes back as it is, and so does an empty one.
///
/// `max_distance` is kept in two steps. A collapse is refused where its vertex, or the middle of a side or
/// one of three points inside a face that it makes, is further from the input than a reach, 0.8 of the
/// distance at first. When all is done, `surface_distance` with the spacing that it takes by itself measures
/// both sides; where that is over the bound (something thin has gone, say), the reach is halved around the
/// places that are too far, and all is done again, 16 times at most: then the input comes back. The guarantee
/// is that measured distance.
///
/// Cost: about 2 µs a collapse on one thread, and 65 bytes a face of the input beside it and the result. With
/// `max_distance` each of typically 5 to 10 rounds takes ten times that, and the search trees 72 bytes a face
/// more.
TriMesh simplify(const TriMesh& mesh, const SimplifyOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
