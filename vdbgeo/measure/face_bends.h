// The angles between neighbouring faces.
#pragma once

#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {

/// Of each side 3 f + k of a face, which runs from its corner k to k + 1: the face across it and the angle
/// between the normals. Sides of one face, of three faces and more, of caps, and of two faces that run along
/// them in the same direction have none.
struct FaceBends {
    static constexpr std::uint32_t none = 0xFFFFFFFFu;

    Array<std::uint32_t> across;
    Array<float> angle;  ///< radians, positive where the surface bends away from the normals; 0 without a
                         ///< face across

    /// 24 bytes a face.
    FaceBends(const TriMesh& mesh, const VertexFaces& faces);
};

}  // namespace vdbgeo
