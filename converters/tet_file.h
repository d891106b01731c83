// Tetrahedral mesh files both ways: VTU, Medit, Gmsh, TetGen.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo {

/// Writes a mesh in the format that the name's ending tells (upper or lower case), in Å:
///
/// - .vtu VTK's unstructured grid, appended raw: tetrahedra, then the faces as triangles; the cell array
///   `region` (of a face: the region behind it) and `outside` (the region before a face, −1 for tetrahedra);
///   properties as Float32 (NaN on the cells that they do not belong to);
/// - .mesh Medit (ASCII, version 2): vertices, tetrahedra with the region as reference, triangles with the
///   reference of their pair of regions; .meshb is not written;
/// - .msh Gmsh 4.1, binary: a volume entity and a physical group `region_N` for each region, a surface entity
///   and a physical group for each pair of regions (`boundary_N`, `interface_N_M`);
/// - .node, .ele: TetGen's, with .face beside: names FILE.node, FILE.ele, FILE.face, whichever of the
///   first two is named; region attributes and boundary markers.
///
/// Pairs of regions are numbered from 1, sorted by the region behind and the one before; remarks or names in
/// the file tell them. Coordinates come back with the same bits, tetrahedra in the same order; properties
/// come back from .vtu alone. Faces are found for a mesh that has none yet, on a copy.
///
/// Throws InvalidInput for another ending, a mesh that check() refuses, and in .vtu for properties whose
/// names the format cannot hold; IoError where writing fails, and then no old file is touched. The three
/// files of TetGen get their names when all are complete. The same bytes for any number of threads; some 20
/// MB of memory, for Gmsh 4 bytes a tetrahedron and 8 a point besides.
void write_tets(const TetMesh& mesh, const std::filesystem::path& path, const Progress& progress = {});

/// Reads what write_tets writes, and what other programs write in these formats: Medit ASCII, Gmsh 2 and 4.1
/// (text and binary; vertices in the order of node tags, tetrahedra in that of element tags, which may be any
/// numbers), TetGen's files counted from 0 or 1, VTU in all its encodings. Elements of other kinds (lines,
/// points, triangles) are passed over; hexahedra and the like are refused by name, as is a file of triangles
/// alone; quadratic tetrahedra lose their middle nodes with no word.
///
/// Regions come from references, physical groups (entities where no tetrahedron is in a group), the first
/// attribute or the array `region`: whole numbers from 1 stay, all other labels get the next free numbers,
/// the least label first; without labels all is region 1. Faces are set anew from the tetrahedra and regions.
/// Where every tetrahedron is turned over all are turned back; otherwise they are left as they are.
///
/// Throws IoError where a file cannot be read, and InvalidInput, naming line, byte or array, where it is
/// damaged: counts are compared with the file's length before memory is taken, corners must name existing
/// points, coordinates must be finite, no two tetrahedra may be on the same side of a triangle. One pass over
/// the file; memory: the mesh, and 8 bytes a tetrahedron (Gmsh: 28, and 8 a point).
TetMesh read_tets(const std::filesystem::path& path, const Progress& progress = {});

/// The endings that write_tets knows, with their dots, and as one text.
std::vector<std::string> tet_endings();
std::string tet_endings_text();

/// Whether the name has one of these endings.
bool is_tet_ending(const std::filesystem::path& path);

/// Whether a file holds tetrahedra: by its ending, a .vtu file by its content.
bool holds_tets(const std::filesystem::path& path);

}  // namespace vdbgeo
