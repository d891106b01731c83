// A mesh that is looked up where it lies.
#pragma once

#include <cstddef>
#include <cstdint>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// A mesh that lies somewhere else than in memory.
class StoredMesh {
 public:
    virtual ~StoredMesh() = default;
    virtual std::uint64_t vertices() const = 0;  ///< at most TriMesh::max_vertices
    virtual std::uint64_t faces() const = 0;
    /// Faces [first, first + count), and whether they are caps.
    virtual void read_faces(std::uint64_t first, std::size_t count, Triangle* triangles,
                            char* caps) const = 0;
    /// From any thread.
    virtual Vec3f point(VertexId v) const = 0;
    /// Memory that looking at points took goes back.
    virtual void release() const = 0;
};

}  // namespace vdbgeo
