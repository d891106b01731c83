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
/// and
///   a physical group for each pair of regions (`boundary_N`, `interface_N_M`);
/// - .node, .ele: TetGen's, with .face beside: names FILE.node, FILE.ele, FILE.face, whichever of the first
/// two
///   is named; region attributes and boundary markers.
///
/// Coordinates come back with the same bits. Throws InvalidInput for another ending and a mesh that check()
/// refuses; IoError where writing fails, and then no old file is touched.
void write_tets(const TetMesh& mesh, const std::filesystem::path& path, const Progress& progress = {});

/// Reads what write_tets writes, and what other programs write in these formats: Medit ASCII, Gmsh 2.2
/// and 4.1 (text and binary), TetGen's files counted from 0 or 1, VTU in all its encodings. Elements of other
/// kinds (lines, points) are passed over; hexahedra and the like are refused by name, quadratic tetrahedra
/// lose their middle nodes with no word. Regions come from references, physical groups, attributes or the
/// array `region` (0 becomes the next free number); where there is none all is region 1. Faces are set anew
/// from the tetrahedra and regions. Turned-over tetrahedra are turned back where the whole file has the other
/// orientation. Throws IoError, InvalidInput as read_mesh does.
TetMesh read_tets(const std::filesystem::path& path, const Progress& progress = {});

/// The endings that write_tets knows, with their dots, and as one text.
std::vector<std::string> tet_endings();
std::string tet_endings_text();

/// Whether the name has one of these endings.
bool is_tet_ending(const std::filesystem::path& path);

/// Whether a file holds tetrahedra: by its ending, a .vtu file by its content.
bool holds_tets(const std::filesystem::path& path);

}  // namespace vdbgeo
