#include "apps/tet_reports.h"

#include <fmt/format.h>

#include <algorithm>

#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/plot.h"

namespace vdbgeo::app {
namespace {

/// Regions told one by one; files with thousands of labels say how many there are.
constexpr std::size_t most_lines = 20;

constexpr const char* histogram_title = "Dihedral angles of the tetrahedra";

}  // namespace

Json tets_json(const TetQuality& q) {
    Json j;
    j["vertices"] = q.vertices;
    j["tets"] = q.tets;
    j["volume_A3"] = q.volume_A3;
    j["min_dihedral_deg"] = q.min_dihedral_deg;
    j["max_dihedral_deg"] = q.max_dihedral_deg;
    j["radius_edge_max"] = q.radius_edge_max;
    j["radius_edge_mean"] = q.radius_edge_mean;
    j["slivers"] = q.slivers;
    j["inverted"] = q.inverted;
    j["boundary_faces"] = q.boundary_faces;
    j["mean_min_dihedral_deg"] = q.mean_min_dihedral_deg;
    j["min_dihedral_p01_deg"] = q.min_dihedral_p01_deg;
    j["min_tet_volume_A3"] = q.min_volume_A3;
    j["max_tet_volume_A3"] = q.max_volume_A3;
    j["mean_edge_A"] = q.mean_edge_A;
    j["min_edge_A"] = q.min_edge_A;
    j["max_edge_A"] = q.max_edge_A;
    j["regions"] = Json::array();
    for (const TetRegion& r : q.regions)
        j["regions"].push_back({{"region", r.region}, {"tets", r.tets}, {"volume_A3", r.volume_A3}});
    return j;
}

std::vector<std::string> tets_text(const TetQuality& q) {
    std::vector<std::string> lines{
        fmt::format("vertices    {}", q.vertices),
        fmt::format("tetrahedra  {}, {} faces on the boundary", q.tets, q.boundary_faces),
        fmt::format("volume      {:.6g} Å³, {:.3g} to {:.3g} Å³ each", q.volume_A3, q.min_volume_A3,
                    q.max_volume_A3),
        fmt::format("dihedral    {:.3g}° to {:.4g}°, smallest {:.3g}° in the mean; 1 % below {:.3g}°",
                    q.min_dihedral_deg, q.max_dihedral_deg, q.mean_min_dihedral_deg, q.min_dihedral_p01_deg),
        fmt::format("radius-edge {:.3g} mean, {:.3g} largest (0.612 is ideal)", q.radius_edge_mean,
                    q.radius_edge_max),
        fmt::format("edges       {:.4g} Å mean, {:.4g} to {:.4g} Å", q.mean_edge_A, q.min_edge_A,
                    q.max_edge_A),
        fmt::format("slivers     {} (an angle below {:g}° or above {:g}°)", q.slivers, TetQuality::sliver_deg,
                    180 - TetQuality::sliver_deg)};
    if (q.inverted > 0) lines.push_back(fmt::format("inverted    {} flat or turned over", q.inverted));
    if (q.regions.size() < 2) return lines;
    for (std::size_t i = 0; i < std::min(most_lines, q.regions.size()); ++i)
        lines.push_back(fmt::format("region {:<4} {} tetrahedra, {:.6g} Å³", q.regions[i].region,
                                    q.regions[i].tets, q.regions[i].volume_A3));
    if (q.regions.size() > most_lines)
        lines.push_back(fmt::format("regions     {} in all", q.regions.size()));
    return lines;
}

void write_dihedral_histogram(const std::vector<std::pair<std::string, TetQuality>>& meshes,
                              const std::string& path, const Theme& theme) {
    PlotOptions options;
    options.theme = theme;
    options.title = histogram_title;
    options.x_label = "dihedral angle (°)";
    if (meshes.size() == 1) {
        const auto& counts = meshes[0].second.dihedral_histogram;
        options.y_label = "angles a degree";
        return write_drawing(plot_histogram({counts.begin(), counts.end()}, 0, 180, options), path);
    }
    options.y_label = "share of the angles (% a degree)";
    const Colormap colours("categorical");
    std::vector<Curve> curves;
    for (const auto& [name, q] : meshes) {
        Curve curve{name, {}, {}, colours.category(static_cast<std::int64_t>(curves.size()))};
        const double angles = 6 * static_cast<double>(std::max<std::uint64_t>(1, q.tets));
        for (std::size_t k = 0; k < q.dihedral_histogram.size(); ++k) {
            curve.x.push_back(static_cast<double>(k) + 0.5);
            curve.y.push_back(100 * static_cast<double>(q.dihedral_histogram[k]) / angles);
        }
        curves.push_back(std::move(curve));
    }
    write_drawing(plot_curves(curves, false, options), path);
}

}  // namespace vdbgeo::app
