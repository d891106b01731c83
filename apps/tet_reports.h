// Numbers of tetrahedral meshes as JSON (the stable keys) and as lines to read.
#pragma once

#include <string>
#include <vector>

#include "apps/session.h"
#include "vdbgeo/tet/tet_quality.h"

namespace vdbgeo::app {

/// vertices, tets, volume_A3, min_dihedral_deg, max_dihedral_deg, radius_edge_max, radius_edge_mean, slivers, and
/// more.
Json tets_json(const TetQuality& quality);
std::vector<std::string> tets_text(const TetQuality& quality);

/// Histograms of the dihedral angles of one or several meshes as curves, as a picture (.png or .svg).
void write_dihedral_histogram(const std::vector<std::pair<std::string, TetQuality>>& meshes,
                              const std::string& path);

}  // namespace vdbgeo::app
