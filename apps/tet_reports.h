// Numbers of tetrahedral meshes as JSON (the stable keys) and as lines to read.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "apps/plots.h"
#include "apps/session.h"
#include "vdbgeo/tet/tet_quality.h"

namespace vdbgeo::app {

/// vertices, tets, volume_A3, min_dihedral_deg, max_dihedral_deg, radius_edge_max, radius_edge_mean, slivers,
/// inverted, boundary_faces, mean_min_dihedral_deg, min_dihedral_p01_deg, min_tet_volume_A3,
/// max_tet_volume_A3, mean_edge_A, min_edge_A, max_edge_A; regions[]: region, tets, volume_A3.
Json tets_json(const TetQuality& quality);
std::vector<std::string> tets_text(const TetQuality& quality);

/// Histogram of the dihedral angles as a plot; of several meshes as curves.
void write_dihedral_histogram(const std::vector<std::pair<std::string, TetQuality>>& meshes,
                              const std::string& path, const Theme& theme = Theme::light());

}  // namespace vdbgeo::app
