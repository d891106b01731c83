// The meshes of a report: made small enough for a page, with the values that it colours them by.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/view/page_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo::app {

/// A mesh as it goes into the page.
struct PageMesh {
    std::string json;                  ///< empty: none
    std::uint64_t shown = 0;           ///< faces or tetrahedra
    std::vector<std::string> remarks;  ///< what was done to it, for readers
};

/// A surface, in as many faces as a page may have.
///
/// More are simplified away (simplify, after repair where the mesh is no oriented manifold). Where that
/// leaves too many, because pieces end as tetrahedra, the smallest pieces are left out. Values are those of
/// the full mesh: scalars blended over the nearest face, categories of the nearest vertex.
class PageSurface {
 public:
    explicit PageSurface(TriMesh mesh);

    const TriMesh& mesh() const { return mesh_; }
    /// NumericalError where nothing that can be shown is left.
    PageMesh at_most(std::uint64_t faces, const Progress& progress);

 private:
    TriMesh reduced(std::uint64_t faces, std::vector<std::string>& remarks, const Progress& progress) const;
    std::vector<PageProperty> carried(const TriMesh& shown);

    TriMesh mesh_;
    std::vector<PageProperty> properties_;
    std::unique_ptr<TriangleTree> tree_;
};

/// Tetrahedra, as many as a page may have.
///
/// Where there are more, the body that they fill is filled anew with larger ones (isosurface stuffing of the
/// signed distance to its boundary). Coloured by the smallest dihedral angle.
class PageTets {
 public:
    explicit PageTets(TetMesh mesh) : mesh_(std::move(mesh)) {}

    const TetMesh& mesh() const { return mesh_; }
    /// NumericalError where the body has no such filling.
    PageMesh at_most(std::uint64_t tets, const Progress& progress);

 private:
    TetMesh coarser(std::uint64_t tets, const Progress& progress);

    TetMesh mesh_;
    std::optional<TriMesh> boundary_;
    std::optional<DensityMap> inside_;  ///< distance to the boundary, positive inside, at voxels of voxel_A_
    double voxel_A_ = 0;
    double side_A_ = 0;  ///< of the cubes that were used last
};

/// What a page can colour a surface by: the scalars that it has at its vertices, curvature first.
std::vector<PageProperty> page_properties(const TriMesh& mesh);

}  // namespace vdbgeo::app
