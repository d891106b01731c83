// What mesh formats have in common about properties: names, colours, and meshes that come in parts.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::mesh_formats {

/// The property that is a colour: three components of 0…1.
inline bool is_color(const MeshProperty& p) { return p.name == "color" && p.components == 3; }

/// The vertices' colours, nullptr where there are none.
const MeshProperty* vertex_color(const TriMesh& mesh);

/// A component of a colour as files hold it: 0…1, and 0 for what is not a number.
inline float color_value(float c) { return c > 0 ? (c < 1 ? c : 1.0f) : 0.0f; }
inline std::uint8_t color_byte(float c) { return static_cast<std::uint8_t>(color_value(c) * 255 + 0.5f); }

/// Throws InvalidInput unless every name is one or more printable ASCII characters and stands there once.
/// `format` is what the message says cannot hold it.
void check_names(const std::vector<MeshProperty>& properties, const std::string& file, const char* format);

/// The properties of the first part that all others have with as many components, with the values of all.
std::vector<MeshProperty> common_properties(const std::vector<const std::vector<MeshProperty>*>& parts);

/// All parts as one mesh, in order. Properties stay that all parts have with as many components. Throws
/// InvalidInput "FILE: …" for more vertices than a mesh can have.
TriMesh join_parts(std::vector<TriMesh> parts, const std::string& file);

}  // namespace vdbgeo::mesh_formats
