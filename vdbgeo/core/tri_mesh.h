// The plain indexed triangle mesh: the currency between the stages.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// Vertex numbers take 32 bits: a mesh of 2^32 vertices would take 150 GB, and half the memory traffic of
/// everything smaller is saved. Counts are 64-bit everywhere; whatever makes a mesh checks `max_vertices`.
using VertexId = std::uint32_t;
using Triangle = std::array<VertexId, 3>;

/// A named value per vertex or per face with `components` floats each (1 scalar, 3 vector).
struct MeshProperty {
    std::string name;
    int components = 1;
    std::vector<float> values;  ///< components × number of vertices (or faces), element after element
};

/// The face property that is above ½ on caps: faces that close a surface at the border of a map and are no
/// part of the specimen. Areas and curvatures leave them out.
inline constexpr const char* cap_property = "cap";

/// Triangles over shared points, in Å. Counter-clockwise seen from outside: normals point from dense to
/// empty.
struct TriMesh {
    static constexpr std::uint64_t max_vertices = 0xFFFFFFFFull;

    Array<Vec3f> points;
    Array<Triangle> triangles;
    std::vector<MeshProperty> vertex_properties;
    std::vector<MeshProperty> face_properties;

    bool empty() const { return triangles.empty(); }
    const MeshProperty* find_vertex_property(const std::string& name) const;
    const MeshProperty* find_face_property(const std::string& name) const;
};

/// Throws InvalidInput unless every triangle names existing points, every coordinate is finite, and every
/// property has as many values as the mesh has elements. `what` begins the message (a file's name, say).
void check(const TriMesh& mesh, const std::string& what);

}  // namespace vdbgeo
