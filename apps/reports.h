// Numbers of maps, grids and meshes as JSON (the stable keys) and as lines to read.
#pragma once

#include <string>
#include <vector>

#include "apps/session.h"
#include "converters/map_file.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/measure/surface_distance.h"

namespace vdbgeo::app {

Json versions_json();
std::string versions_text();

Json to_json(const Vec3d& v);
Json one_sided_json(const OneSidedDistance& d);
Json measures_json(const MeshMeasures& m);
std::vector<std::string> measures_text(const MeshMeasures& m);

/// Header, frame and statistics of an MRC or CCP4 file.
Json mrc_json(const MrcReader& reader, const Statistics& statistics,
              const std::vector<std::string>& warnings);
/// What every map and grid tells: size, voxel_size_A, origin_A; min, max, mean, rms.
Json frame_json(const Frame& frame);
Json statistics_json(const Statistics& statistics);
/// A grid in memory, or a streamed one.
Json grid_json(const DensityMap& map);

/// A JSON object as aligned "key  value" lines.
std::vector<std::string> as_lines(const Json& object);

}  // namespace vdbgeo::app
