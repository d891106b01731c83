// The surface of a map as a level set: the signed distance to it, in a narrow band.
#pragma once

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct LevelSetOptions {
    /// Half the width of the band, in voxels: 3 (what OpenVDB's tools expect) to 100.
    double half_width = 3;

    void check() const;
};

/// The signed distance φ (Å) to the surface of a map at `isovalue`, as an OpenVDB level set `surface`: φ < 0
/// inside, where the density is at or above the isovalue; voxels with |φ| < half_width · voxel are active,
/// all others are ±half_width · voxel by their side, tiles and cavities too.
///
/// |φ| is the distance to the triangles that marching_cubes gives, exactly (OpenVDB's
/// meshToVolume errs by a sixth of a voxel at the band's edge); the sign that of
/// the density itself. What lies outside the box of the map is empty, so that a surface that meets the border
/// is closed there, half a voxel outside or so. Against a true distance the error is that of the triangles,
/// second order in the voxel.
///
/// Level sets need cubic voxels. Where those of the map are cubic the grid has the map's indices and
/// transform, a turned frame among them; else it has a frame of its own along x, y, z whose voxel is the
/// map's smallest, and the sign is that of the trilinear density. A level set (negative inside) is taken too,
/// at any isovalue.
///
/// Cost: that of marching_cubes, some µs a voxel of the band, and 16 bytes a triangle. Throws InvalidInput
/// for an isovalue that is not finite, NumericalError where nothing crosses it; Cancelled.
openvdb::FloatGrid::Ptr level_set(const DensityMap& map, double isovalue, const LevelSetOptions& options = {},
                                  const Progress& progress = {});

/// The same for a closed mesh: the signed distance to its triangles on cubes of `voxel_A` (Å) whose centres
/// are at multiples of it. Inside is where the line up goes through an odd number of faces (MeshSolid), so
/// that cavities, shells in cavities and faces turned inward all come out right. An open mesh has no inside:
/// its level set means nothing (require, of measure, refuses it).
///
/// Cost: some µs a voxel of the band. Throws InvalidInput for a mesh without faces and a voxel that is not a
/// number above 0, or so small that the mesh has 2^30 of them along an axis; Cancelled.
openvdb::FloatGrid::Ptr mesh_level_set(const TriMesh& mesh, double voxel_A,
                                       const LevelSetOptions& options = {}, const Progress& progress = {});

}  // namespace vdbgeo
