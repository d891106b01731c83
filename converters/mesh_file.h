// Triangle mesh files both ways: PLY, OBJ, OFF, STL.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Reads a triangle mesh; coordinates are taken for Å. PLY and OFF files are known by their first word,
/// whatever they are called; OBJ and STL by the name's ending. "-" and pipes are read where the content tells
/// the format.
///
/// | format | is read | becomes a property |
/// |---|---|---|
/// | PLY | ascii, binary of either byte order | all scalar properties of vertices and faces, as floats |
/// | OBJ | v, and f as v, v/vt, v//vn, v/vt/vn, also counted backwards | - |
/// | OFF | ascii OFF, with any of the prefixes ST, C, N | the normals of NOFF |
/// | STL | binary, known by the file's size, or ascii | - |
///
/// - In a PLY file three scalars in a row called a_x, a_y, a_z become one property `a` of 3 components, and
/// nx,
///   ny, nz the property `normal`. Lists other than the faces' corners are passed over, as are texture
///   coordinates, colours of OFF and OBJ, and the facet normals of STL. Integers beyond 2^24 and doubles lose
///   digits. A face's properties go to each triangle of it.
/// - Polygons are cut into a fan around their first corner. Nothing is repaired: a triangle that names a
/// vertex
///   twice or has no area stays, as do vertices without a face.
/// - STL has no vertices of its own: corners whose three coordinates have the same bits become one vertex,
/// and
///   vertices are numbered by first appearance. (0 and -0 have different bits.)
/// - A mesh of 0 faces, and of 0 vertices, is a mesh.
///
/// Throws IoError where the file cannot be read, and InvalidInput, naming line or byte, where it is damaged:
/// what a header promises is compared with the file's length before any memory is taken; coordinates must be
/// finite, corners must name existing vertices. Binary files take one pass; memory: the mesh (regular files
/// are mapped).
TriMesh read_mesh(const std::filesystem::path& path, const Progress& progress = {});

struct MeshWriteOptions {
    /// Significant digits of coordinates in text formats (OBJ, OFF), 1…9. Unset: as many as give the same
    /// float back, which 9 always do.
    std::optional<int> digits;

    void check() const;
};

/// Writes a mesh in the format that the name's ending tells (upper or lower case):
/// .ply binary little-endian with all properties as floats (3 components as name_x, name_y, name_z; `normal`
/// as nx, ny, nz; other counts n as name_0 … name_n-1, which come back as n scalars); .obj, .off vertices and
/// faces as text; .stl binary with unit normals, 0 0 0 for a triangle without area. Only PLY keeps
/// properties. Coordinates come back with the same bits from each format, unless `digits` says otherwise.
///
/// Throws InvalidInput for another ending (naming the known ones), for a mesh that fails check(), for
/// property names that PLY cannot hold (empty, with blanks, twice the same), and for more triangles than the
/// 2^32-1 of STL; IoError where writing fails, and then an old file is untouched. The same bytes for any
/// thread count. Written in chunks: takes some 20 MB on top of the mesh.
void write_mesh(const TriMesh& mesh, const std::filesystem::path& path, const MeshWriteOptions& options = {},
                const Progress& progress = {});

/// The endings that write_mesh knows, with their dots: ".ply" …
std::vector<std::string> mesh_endings();

/// Whether the name has one of these endings, in upper or lower case.
bool is_mesh_ending(const std::filesystem::path& path);

}  // namespace vdbgeo
