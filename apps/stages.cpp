#include "apps/stages.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "apps/surface_in_blocks.h"
#include "converters/mesh_file.h"
#include "converters/nanovdb_file.h"
#include "vdbgeo/view/colormap.h"
#include "vdbgeo/view/plot.h"
#include "vdbgeo/volume/grid_builder.h"

namespace vdbgeo::app {

Surface extract_surface(const std::string& name, const MapFile& in, const Isovalue& rule,
                        const Progress& progress, const SurfaceFlags& flags) {
    Surface surface;
    naming(name, [&] {
        surface.isovalue = rule.resolve(in.map);
        surface.mesh = flags.extract(in, surface.isovalue, progress);
    });
    need_surface(name, surface.mesh.triangles.size(), surface.isovalue, in.map.statistics);
    return surface;
}

void take_output(Session& session) {
    if (session.json) throw UsageError("-: standard output cannot take both the file and what --json prints");
    session.output_taken = true;
}

void check_map_output(const std::string& path, Session& session) {
    if (path == "-") return take_output(session);
    for (const char* packed : {".bz2", ".zst", ".vdb.gz"})
        if (has_ending(path, packed))
            throw UsageError(
                fmt::format("{}: maps are written plain or as .mrc.gz; compress the file afterwards", path));
    if (is_nanovdb_ending(path)) {
        if (!have_nanovdb()) throw UsageError(fmt::format("{}: this build writes no NanoVDB files", path));
    } else if (!is_vdb_ending(path) && !is_map_ending(path)) {
        throw UsageError(
            fmt::format("{}: the ending tells the format: .vdb .nvdb or .mrc .map .ccp4 .rec", path));
    }
}

std::optional<MrcWriteReport> write_map(const DensityMap& map, const std::string& path,
                                        const VdbWriteOptions& vdb, const MrcWriteOptions& mrc,
                                        const Progress& progress) {
    if (!is_vdb_ending(path) && !is_nanovdb_ending(path)) return write_mrc(map, path, mrc, progress);
    if (is_vdb_ending(path))
        write_vdb({map.grid}, path, vdb, progress);
    else
        write_nanovdb({map.grid}, path, progress);
    return std::nullopt;
}

DensityMap phantom_map(const Phantom& phantom, bool truth, const Progress& progress) {
    const Vec3i size = phantom.frame().size;
    GridBuilder builder(size, {0, 1, 2});
    Array<float> slab(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
                      GridBuilder::slab);
    for (int z = 0; z < size.z(); z += GridBuilder::slab) {
        const int end = std::min(size.z(), z + GridBuilder::slab);
        if (truth)
            phantom.truth_sections(z, end, slab.data());
        else
            phantom.sections(z, end, slab.data());
        builder.add_sections(slab.data(), end - z);
        progress.report(static_cast<double>(end) / size.z());
    }
    return builder.finish(phantom.frame());
}

void say_where_open(const MeshMeasures& m, Session& session) {
    if (m.boundary_edges > 0)
        session.warn(fmt::format(
            "the surface is open where the density meets the border of the map ({} edges): no volume",
            m.boundary_edges));
}

std::vector<std::string> write_pieces(const TriMesh& mesh, const std::string& path,
                                      const Progress& progress) {
    const MeshComponents pieces = mesh_components(mesh, progress.part(0, 0.2));
    const std::size_t count = pieces.components.size();
    constexpr std::size_t most = 1000;
    if (count > most)
        throw InvalidInput(fmt::format(
            "{}: --split would write {} files, more than {}; drop dust first (--min-volume, --keep-largest)",
            path, count, most));
    const std::filesystem::path out(path);
    const std::string stem = (out.parent_path() / out.stem()).string(), ending = out.extension().string();
    const std::size_t digits = std::max<std::size_t>(4, fmt::format("{}", count).size());
    std::vector<std::string> names;
    for (std::size_t i = 0; i < count; ++i) {
        std::vector<bool> keep(count, false);
        keep[i] = true;
        names.push_back(fmt::format("{}_{:0{}}{}", stem, i + 1, digits, ending));
        write_mesh(extract_components(mesh, pieces, keep), names.back());
        progress.report(0.2 + 0.8 * static_cast<double>(i + 1) / static_cast<double>(count));
    }
    return names;
}

void check_folder_of(const std::string& path) {
    if (path.empty() || path == "-") return;
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    std::error_code error;
    if (!folder.empty() && !std::filesystem::is_directory(folder, error))
        throw IoError(fmt::format("{}: cannot be made: there is no folder {}", path, folder.string()));
}

void check_mesh_output(const std::string& path) {
    if (!is_mesh_ending(path))
        throw UsageError(fmt::format("{}: the ending tells the format: {}", path, mesh_endings_text()));
}

void write_angle_histogram(const MeshMeasures& measures, const std::string& path, const Theme& theme) {
    PlotOptions options;
    options.theme = theme;
    options.title = "Angles of the triangles";
    options.x_label = "angle (°)";
    options.y_label = "angles a degree";
    write_drawing(
        plot_histogram({measures.angle_histogram.begin(), measures.angle_histogram.end()}, 0, 180, options),
        path);
}

void write_angle_histograms(const std::vector<std::pair<std::string, MeshMeasures>>& meshes,
                            const std::string& path, const Theme& theme) {
    if (meshes.size() == 1) return write_angle_histogram(meshes[0].second, path, theme);
    const Colormap colours("categorical");
    PlotOptions options;
    options.theme = theme;
    options.title = "Angles of the triangles";
    options.x_label = "angle (°)";
    options.y_label = "share of the angles (% a degree)";
    std::vector<Curve> curves;
    for (const auto& [name, m] : meshes) {
        Curve curve{name, {}, {}, colours.category(static_cast<std::int64_t>(curves.size()))};
        for (std::size_t k = 0; k < m.angle_histogram.size(); ++k) {
            curve.x.push_back(static_cast<double>(k) + 0.5);
            curve.y.push_back(100 * static_cast<double>(m.angle_histogram[k]) /
                              (3 * static_cast<double>(std::max<std::uint64_t>(1, m.faces))));
        }
        curves.push_back(std::move(curve));
    }
    write_drawing(plot_curves(curves, false, options), path);
}

void plot_isovalues(const std::vector<IsovalueRow>& rows, const std::string& path,
                    const std::optional<MarkedLevel>& level, const Theme& theme) {
    if (rows.empty()) throw NumericalError("no isovalue gives a surface: there is nothing to draw");
    const Colormap colours("categorical");
    std::vector<Curve> curves{{"volume (Å³)", {}, {}, colours.category(0)},
                              {"area (Å²)", {}, {}, colours.category(1)},
                              {"pieces", {}, {}, colours.category(2)}};
    PlotOptions options;
    options.title = "The surface at each isovalue";
    options.x_label = "isovalue (the map's units)";
    options.y_label = "volume, area, number";
    options.theme = theme;
    if (level) options.marks = {{level->isovalue, level->label}};
    options.x_low = rows[0].isovalue;
    for (const IsovalueRow& row : rows) {
        options.x_low = std::min(options.x_low, row.isovalue);
        for (Curve& curve : curves) curve.x.push_back(row.isovalue);
        curves[0].y.push_back(row.volume_A3);
        curves[1].y.push_back(row.area_A2);
        curves[2].y.push_back(static_cast<double>(row.components));
    }
    write_drawing(plot_curves(curves, true, options), path);
}

bool has_ending(const std::string& name, const std::string& ending) {
    return name.size() > ending.size() &&
           name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace vdbgeo::app
