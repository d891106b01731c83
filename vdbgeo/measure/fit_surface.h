// What fits to a surface begin with: its mesh without caps, who is joined to whom, normals, areas.
#pragma once

#include <utility>

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/core/vertex_neighbours.h"

namespace vdbgeo {

/// A mesh prepared for fits around its vertices. 60 bytes a face or so; the mesh must outlive it.
class FitSurface {
 public:
    explicit FitSurface(const TriMesh& mesh);

    const TriMesh& mesh() const { return without_caps_.triangles.empty() ? mesh_ : without_caps_; }
    const VertexNeighbours& neighbours() const { return neighbours_; }
    /// Unit, by the areas of the faces around; zero where there are none or they cancel.
    const Vec3f& normal(VertexId v) const { return normals_[v]; }
    /// A third of the areas of the faces around.
    float area(VertexId v) const { return areas_[v]; }
    /// The vertex, moved by its shift where there are any.
    Vec3d point(VertexId v) const {
        Vec3d p = mesh_.points[v].cast<double>();
        if (!shifts_.empty()) p += shifts_[v].cast<double>();
        return p;
    }
    /// Moves each vertex for the fits; normals and areas stay. Shifts apart keep their digits, which are lost
    /// in coordinates.
    void set_shifts(Array<Vec3f> shifts) { shifts_ = std::move(shifts); }

 private:
    static TriMesh without_caps(const TriMesh& mesh);

    const TriMesh& mesh_;
    TriMesh without_caps_;  // empty where the mesh has none
    VertexNeighbours neighbours_;
    Array<Vec3f> normals_;
    Array<float> areas_;
    Array<Vec3f> shifts_;  // empty for none
};

}  // namespace vdbgeo
