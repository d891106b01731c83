// Triangle mesh files both ways: PLY, OBJ, OFF, STL, VTK's XML, glTF.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Reads a triangle mesh; coordinates are taken for Å. PLY, OFF, glTF and VTK files are known by how
/// they begin, whatever they are called; OBJ and STL by the name's ending. "-" and pipes are read where
/// the content tells the format.
///
/// | format | is read | becomes a property |
/// |---|---|---|
/// | PLY | ascii, binary of either byte order | all scalars of vertices and faces, as floats |
/// | OBJ | v, and f as v, v/vt, v//vn, v/vt/vn, also backwards | r, g, b behind every v: `color` |
/// | OFF | ascii, with any of the prefixes ST, C, N | normals of NOFF, colours of COFF |
/// | STL | binary, known by the file's size, or ascii | - |
/// | VTP, VTU | XML of VTK, in all its encodings, plain or zlib | arrays of points and cells |
/// | VTK | old files of PolyData, text or binary | arrays of points and cells |
/// | glTF | .glb: triangles, strips, fans, points, placed by nodes | NORMAL, COLOR_0, _NAME |
///
/// - A colour is a property `color` of 3 components of 0…1: in PLY red, green and blue of 8 or 16 bits
///   or floats; in OFF values above 1 are taken for multiples of 1/255; in VTK an array `color` of
///   bytes. Opacity is passed over (in PLY it becomes `alpha`).
/// - In a PLY file three scalars in a row called a_x, a_y, a_z become one property `a` of 3 components,
///   and nx, ny, nz the property `normal`. Lists other than the faces' corners are passed over, as are
///   texture coordinates, colours of the faces of OFF, and the facet normals of STL. Integers beyond
///   2^24 and doubles lose digits. A face's properties go to each triangle of it.
/// - Polygons are cut into a fan around their first corner, strips into triangles; points and lines of
///   VTK and glTF give no triangle; solid cells of VTK are refused. Nothing is repaired: a triangle
///   that names a vertex twice or has no area stays, as do vertices without a face.
/// - The pieces of a VTK file and the primitives of a glTF file become one mesh, in their order;
///   properties stay that all of them have. A mesh that several nodes show comes as often. Normals are
///   turned with their node, other attributes are not. Values outside the .glb itself, sparse accessors
///   and required extensions that change the shape (compression) are refused.
/// - STL has no vertices of its own: corners whose three coordinates have the same bits become one
///   vertex, and vertices are numbered by first appearance. (0 and -0 have different bits.)
/// - A mesh of 0 faces, and of 0 vertices, is a mesh.
///
/// Throws IoError where the file cannot be read, and InvalidInput, naming line, byte or array, where it
/// is damaged: what a header promises is compared with the file's length before any memory is taken;
/// coordinates must be finite, corners must name existing vertices. Binary files take one pass; memory:
/// the mesh (regular files are mapped), and what is packed in a VTK file.
TriMesh read_mesh(const std::filesystem::path& path, const Progress& progress = {});

struct MeshWriteOptions {
    /// Significant digits of coordinates in text formats (OBJ, OFF), 1…9. Unset: as many as give the same
    /// float back, which 9 always do.
    std::optional<int> digits;

    void check() const;
};

/// Writes a mesh in the format that the name's ending tells (upper or lower case):
///
/// - .ply binary little-endian with all properties as floats (3 components as name_x, name_y, name_z;
///   `normal` as nx, ny, nz; other counts n as name_0 … name_n-1, which come back as n scalars) and
///   colours as red, green, blue of 8 bits;
/// - .obj, .off vertices and faces as text, with the vertices' `color` (OFF: as COFF);
/// - .stl binary with unit normals, 0 0 0 for a triangle without area;
/// - .vtp, .vtu VTK's PolyData or unstructured grid, raw, with all properties as Float32;
/// - .glb glTF 2.0: one primitive of 32-bit indices with a rough white or grey material of two sides;
///   of the vertices' properties `color` is COLOR_0 and others are _NAME (more than 4 components:
///   _NAME_0 …).
///
/// A glTF file has normals: the property `normal`, where that has unit vectors, else the mean of the
/// faces' by area (marked as computed, and not read back). Coordinates are Å there too, though glTF's
/// unit is the metre: asset.extras.unit says angstrom. Colours are clipped to 0…1. Coordinates come
/// back with the same bits from each format, unless `digits` says otherwise, and so do properties, but
/// for colours in PLY, which are rounded to 1/255. STL keeps no properties, OBJ and OFF the colours
/// alone, glTF those of vertices, PLY and VTK all.
///
/// Throws InvalidInput for another ending (naming the known ones), for a mesh that fails check(), for
/// property names that the format cannot hold (empty, not printable ASCII, in PLY with blanks, twice
/// the same), for more triangles than the 2^32-1 of STL and more bytes than the 2^32-1 of glTF; IoError
/// where writing fails, and then an old file is untouched. The same bytes for any thread count. Written
/// in chunks: takes some 20 MB on top of the mesh (glTF: and 36 bytes a vertex for computed normals).
void write_mesh(const TriMesh& mesh, const std::filesystem::path& path, const MeshWriteOptions& options = {},
                const Progress& progress = {});

/// The endings that write_mesh knows, with their dots: ".ply" …
std::vector<std::string> mesh_endings();

/// The same as one text, with blanks between.
std::string mesh_endings_text();

/// Whether the name has one of these endings, in upper or lower case.
bool is_mesh_ending(const std::filesystem::path& path);

/// Whether the name is that of a mesh to read: one of these endings, or .vtk.
bool is_mesh_input(const std::filesystem::path& path);

}  // namespace vdbgeo
