// A mesh in a PLY file that is looked up, not read.
#pragma once

#include <filesystem>
#include <memory>

#include "vdbgeo/core/stored_mesh.h"

namespace vdbgeo {

/// The mesh of a binary PLY file of little endian whose vertices are floats and whose faces are triangles, as
/// vdbgeo writes them; null for any other file. Reads the header alone. Errors as read_mesh; a face of more
/// corners is told when it is looked up (InvalidInput).
std::unique_ptr<StoredMesh> stored_ply(const std::filesystem::path& path);

}  // namespace vdbgeo
