// What a tetrahedralizer made of a closed surface, checked before anybody uses it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/tet/solid_input.h"

namespace vdbgeo {

struct Filling {
    Array<Vec3d> points;
    Array<Tetrahedron> tets;
    Array<std::int32_t> solid;  ///< of each tetrahedron: its place in SolidInput::regions
};

/// A filling as bytes and back, for the way between processes. Throws NumericalError, beginning with `who`,
/// for bytes that are none.
std::vector<std::byte> to_bytes(const Filling& filling);
Filling filling_from_bytes(const std::vector<std::byte>& bytes, const std::string& who);

/// The mesh of a filling. Throws NumericalError, beginning with `who`, unless every tetrahedron has a volume
/// above 0, no two overlap, and every solid has the volume that its surface encloses to 1e-6 of it (by these
/// two, it is filled once and everywhere); with `kept_surface`: unless the points of the surface come first,
/// and the faces of the mesh are those of the surface.
TetMesh filled_mesh(Filling filling, const SolidInput& input, bool kept_surface, const std::string& who);

}  // namespace vdbgeo
