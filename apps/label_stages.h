// What commands on segmentations share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vdbgeo/surface/label_surfaces.h"

namespace vdbgeo::app {

/// "all" (an empty list), or numbers with commas between them; UsageError naming --labels.
std::vector<std::int64_t> parse_labels(const std::string& text);

/// InvalidInput unless the map is a segmentation.
void need_labels(const std::string& file, const DensityMap& map);

/// All surfaces in one mesh, with the face property `label`.
TriMesh join_labels(const std::vector<LabelSurface>& surfaces, const std::string& file);

}  // namespace vdbgeo::app
