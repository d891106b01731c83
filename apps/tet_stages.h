// From a file to tetrahedra: what tetrahedralize and model share.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/session.h"
#include "apps/tet_flags.h"
#include "converters/map_file.h"
#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/tet/tet_components.h"
#include "vdbgeo/volume/isovalue.h"

namespace vdbgeo::app {

/// What is filled: a map at an isovalue, labels of a segmentation, or the inside of a closed mesh.
struct TetInput {
    std::string file;
    TetSource source = TetSource::map;
    DensityMap map;       ///< of a level set: turned over, dense inside
    double isovalue = 0;  ///< of `map`
    std::vector<std::int64_t> labels;
    TriMesh mesh;
    double unit_A = 1;  ///< the smallest voxel step, or the mean edge
    /// The closed surface that results are measured against: marching cubes with caps, the labels' smooth
    /// surfaces, or the mesh.
    TriMesh surface;
};

/// The inside of a map's surface; NumericalError where nothing crosses the isovalue.
TetInput tet_input(const std::string& file, const MapFile& in, const Isovalue& rule,
                   const TetComponentFilter& filter, const Progress& progress);
/// Labels of a segmentation, all for an empty list.
TetInput tet_input(const std::string& file, const MapFile& in, const std::vector<std::int64_t>& labels,
                   const Progress& progress);
/// The inside of a mesh, which has to be closed, oriented and turned outward.
TetInput tet_input(const std::string& file, TriMesh mesh, const TetComponentFilter& filter);

struct TetResult {
    TetMesh mesh;
    std::optional<TetOptimizeReport> optimized;
    /// For TetGen and NetGen of a map: how long the surface took that they fill.
    double surface_seconds = 0;
    double tet_seconds = 0, optimize_seconds = 0;
};

/// Runs the method; errors begin with the file's name.
TetResult make_tets(const TetInput& input, const std::string& method, const TetFlags& flags,
                    const TetComponentFilter& filter, Session& session);

}  // namespace vdbgeo::app
