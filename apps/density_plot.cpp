#include "apps/density_plot.h"

#include <fmt/format.h>

#include <filesystem>

#include "vdbgeo/view/plot.h"

namespace vdbgeo::app {

Drawing plot_densities(const DensityHistogram& histogram, const std::string& name, bool distances,
                       const std::optional<MarkedLevel>& level, const Theme& theme) {
    PlotOptions options;
    options.title = fmt::format("{} of {}", distances ? "Distances" : "Densities",
                                std::filesystem::path(name).filename().string());
    options.x_label = distances ? "distance from the surface (Å)" : "density (the map's units)";
    options.y_label = "voxels a bin";
    options.logarithmic_counts = !distances;
    options.theme = theme;
    if (level) options.marks = {{level->isovalue, level->label}};
    return plot_histogram({histogram.counts.begin(), histogram.counts.end()}, histogram.low, histogram.high,
                          options);
}

}  // namespace vdbgeo::app
