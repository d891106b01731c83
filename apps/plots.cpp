#include "apps/plots.h"

#include <fmt/format.h>

#include <cmath>

#include "apps/session.h"
#include "apps/stages.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/view/svg.h"

namespace vdbgeo::app {

void check_plot_output(const std::string& path) {
    if (!path.empty() && !has_ending(path, ".png") && !has_ending(path, ".svg"))
        throw UsageError(fmt::format("{}: plots are .png or .svg", path));
}

void write_drawing(const Drawing& drawing, const std::string& path) {
    check_plot_output(path);
    if (has_ending(path, ".svg"))
        write_svg(drawing, path);
    else
        write_png(rasterise(drawing), path);
}

void PlotFlags::add(CLI::App& app) { app.add_flag("--dark", dark, "Plots with light lines on dark paper"); }

void PlotFlags::check(bool drawn, const std::string& flags) const {
    if (dark && !drawn) throw UsageError(fmt::format("--dark: belongs to {}", flags));
}

MarkedLevel marked_level(double isovalue, const Statistics& statistics) {
    if (!(statistics.rms > 0)) return {isovalue, fmt::format("isovalue {:.4g}", isovalue)};
    const double sigmas = (isovalue - statistics.mean) / statistics.rms;
    return {isovalue, fmt::format("isovalue {:.4g} (mean {} {:.3g}σ)", isovalue, sigmas < 0 ? "−" : "+",
                                  std::abs(sigmas))};
}

}  // namespace vdbgeo::app
