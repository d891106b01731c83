// The solid that a closed mesh encloses, as a function of place. For what meshes it anew.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/surface/delaunay_mesher.h"

namespace vdbgeo {

/// +∞ inside, −∞ outside: a place is inside where the line up from it goes through an odd number of faces.
/// Faces are found by the square of the xy plane that they lie over. A line through an edge or a vertex is
/// taken to be moved by an infinitesimal (ε, ε²), so that it passes on one side for all faces there.
class MeshSolid final : public Solid {
 public:
    MeshSolid(std::vector<Vec3d> points, const Array<Triangle>& triangles);

    double operator()(const Vec3d& p) const override;
    const std::vector<Vec3d>& points() const { return points_; }
    const Vec3d& low() const { return low_; }
    const Vec3d& high() const { return high_; }

 private:
    bool above(const Triangle& t, const Vec3d& p) const;
    std::size_t square(double v, int axis) const;

    std::vector<Vec3d> points_;
    const Array<Triangle>& triangles_;
    Vec3d low_, high_;
    double side_ = 1;
    std::size_t columns_ = 1, rows_ = 1;
    std::vector<std::size_t> first_;  // of each square's faces
    std::vector<std::uint32_t> faces_;
};

}  // namespace vdbgeo
