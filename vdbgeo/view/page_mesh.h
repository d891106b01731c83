// Meshes packed for the report page: quantised, delta coded, compressed, as JSON that a browser unpacks.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// What a page can colour a mesh by: one value a vertex of a surface, or one a tetrahedron.
struct PageProperty {
    std::string key, name, unit;
    std::string help;  ///< one sentence in plain words
    std::vector<float> values;
    std::string colormap = "sequential";  ///< one of Colormap::names()
    /// A category's values are whole numbers of 0…254; what is none of that is no value. The others are
    /// scalars, NaN where there is no value.
    bool category = false;
    std::vector<std::pair<int, std::string>> classes;  ///< names of a category's values
    /// What the colours span at first. Unset: the 2nd to the 98th percentile of the values, made symmetric
    /// about 0 for the colour map "diverging".
    std::optional<std::array<double, 2>> range;
};

/// ARRAY: whole numbers below 2^bits (8, 16 or 32), `components` of them an element, component after
/// component (all x, then all y …). As a JSON object {"bits","components","count","data"}: within a component
/// each number minus the one before it, modulo 2^bits; the low bytes of all, then their next bytes; a zlib
/// stream of that, in base64. InvalidInput for other bits, and where the number of values is no multiple of
/// the components.
std::string packed_array(const std::vector<std::uint32_t>& values, int bits, int components = 1);

/// INDEX: vertex numbers in which each vertex but the first, 0, comes up after the ones before it. As a JSON
/// object {"count","data"}: next − index for each, where next counts the vertices that have come up, 0 being
/// a new one; 32 bits, packed by bytes as an ARRAY is, without differences. InvalidInput for a list in which
/// a vertex comes up before its turn.
std::string packed_index(const std::vector<VertexId>& corners);

/// A surface as a JSON object: vertices, faces, faces_full, box, position, index, properties (of the
/// vertices). Positions are rounded to 65536 steps of the box along each axis, scalars to 65535 steps of the
/// range that they have, cut at 50 times the width of what is shown at first. Faces come in an order in which
/// neighbours follow each other, vertices by first use; those that no face uses are left out. The same bytes
/// for the same input. Errors: InvalidInput for a mesh that check() refuses, and for properties with another
/// number of values than there are vertices.
std::string packed_surface(const TriMesh& mesh, const std::vector<PageProperty>& properties,
                           std::uint64_t faces_full);

/// The same of tetrahedra, with properties of the tetrahedra: vertices, tets, tets_full, ….
std::string packed_tets(const TetMesh& mesh, const std::vector<PageProperty>& properties,
                        std::uint64_t tets_full);

}  // namespace vdbgeo
