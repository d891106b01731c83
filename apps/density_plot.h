// The histogram of a map's densities as a plot.
#pragma once

#include <optional>
#include <string>

#include "apps/plots.h"
#include "vdbgeo/volume/density_histogram.h"

namespace vdbgeo::app {

/// The densities of the map in file `name` (of a level set the distances, Å), counted logarithmically; the
/// isovalue marked where there is one.
Drawing plot_densities(const DensityHistogram& histogram, const std::string& name, bool distances,
                       const std::optional<MarkedLevel>& level, const Theme& theme);

}  // namespace vdbgeo::app
