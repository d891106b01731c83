// Area, enclosed volume, topology and triangle angles of a mesh.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/stored_mesh.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Numbers in brackets are the paper's equations (Feng, Xia, Tong, Wei 2012, doi:10.1002/cnm.2532).
struct MeshMeasures {
    std::uint64_t vertices = 0;  ///< of the mesh, those that no face uses included
    std::uint64_t faces = 0;
    std::uint64_t edges = 0;
    std::uint64_t unused_vertices = 0;
    std::uint64_t components = 0;             ///< pieces connected through vertices
    std::uint64_t boundary_edges = 0;         ///< edges of one face
    std::uint64_t non_manifold_edges = 0;     ///< edges of three faces or more
    std::uint64_t misoriented_edges = 0;      ///< edges that two faces run through in the same direction
    std::uint64_t non_manifold_vertices = 0;  ///< vertices whose faces do not form one fan
    /// Faces that name a vertex twice. They have no area, and their sides are no edges: all counts but
    /// `faces` are those of the mesh without them.
    std::uint64_t degenerate_faces = 0;
    std::uint64_t duplicate_faces =
        0;  ///< faces on the same three vertices as one before them, either way up
    /// Closed loops of boundary edges. At a vertex with several borders a loop goes on in the same fan of
    /// faces.
    std::uint64_t holes = 0;
    std::int64_t euler_characteristic = 0;  ///< used vertices − edges + faces

    bool closed = false;    ///< every edge has two faces, and there is a face
    bool oriented = false;  ///< no two faces run through an edge in the same direction
    bool manifold = false;  ///< no non-manifold edge or vertex, no degenerate face

    double area_A2 = 0;               ///< Σ triangle areas (Eq 9) without caps, Å²
    double cap_area_A2 = 0;           ///< those of the caps (cap_property), Å²
    std::optional<double> volume_A3;  ///< Σ signed tetrahedra over all faces, caps too (Eq 10), Å³; closed,
                                      ///< oriented meshes only
    /// Handles, all components together; closed, oriented manifolds only.
    std::optional<std::int64_t> genus;

    double min_angle_deg = 0, max_angle_deg = 0, mean_angle_deg = 0;  ///< over all triangles' angles
    std::array<std::uint64_t, 180> angle_histogram{};  ///< angles in [k°, k+1°), 180° in the last
    double angles_below_30_fraction = 0;               ///< of all angles, 0…1

    /// Circumradius over the shortest edge, 1 / (2 sin of the smallest angle): 0.577 for equal sides, 1 at
    /// 30°. Faces without area have none: they count in the histogram's last bin only.
    double radius_edge_max = 0, radius_edge_mean = 0;
    /// Bin k holds ratios in [0.5 + k/20, 0.5 + (k+1)/20), the last all above.
    std::array<std::uint64_t, 40> radius_edge_histogram{};
};

/// Measures a mesh. Any mesh will do: open, non-manifold, degenerate or empty ones are described as they are;
/// a volume is told only where a closed, consistently oriented surface encloses one (positive where normals
/// point outward), with the origin at the mesh's centre so that nothing cancels. Angles are by atan2 (exact
/// for needles); those of a face without area count as 0°, 0° and 180°.
///
/// Angles and ratios are those of all faces, caps included.
///
/// Throws InvalidInput for a mesh that check() refuses, and for 2^32 faces or more. Cost: O(n), parallel, and
/// 20 bytes a face.
MeshMeasures measure_mesh(const TriMesh& mesh, const Progress& progress = {});

/// The same numbers, to the bit, of a mesh that does not fit into memory. Its faces are gone through four
/// times, and once for each range of vertices whose faces, 80 bytes each, fit into three quarters of what is
/// left of `memory` beside 4 bytes for each vertex and 50 MB for faces on their way. The last quarter is for
/// borders, 72 bytes an edge. NumericalError where this does not do. Pages of the points that the mesh looks
/// up in a file come on top, for a million faces at a time: few where faces that follow each other are
/// neighbours.
MeshMeasures measure_mesh(const StoredMesh& mesh, std::uint64_t memory, const Progress& progress = {});

}  // namespace vdbgeo
