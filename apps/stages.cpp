#include "apps/stages.h"

#include <fmt/format.h>

#include <algorithm>

#include "converters/nanovdb_file.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/view/plot.h"
#include "vdbgeo/view/png.h"
#include "vdbgeo/volume/grid_builder.h"

namespace vdbgeo::app {

Surface extract_surface(const std::string& name, const MapFile& in, const Isovalue& rule,
                        const Progress& progress) {
    Surface surface;
    naming(name, [&] {
        surface.isovalue = rule.resolve(in.map);
        surface.mesh = marching_cubes(in.map, {surface.isovalue}, progress);
    });
    if (surface.mesh.empty())
        throw NumericalError(
            fmt::format("{}: no surface at the isovalue {:.6g}: the map's values lie between {:.6g} and "
                        "{:.6g}; try another --iso",
                        name, surface.isovalue, in.map.statistics.min, in.map.statistics.max));
    if (in.level_set)
        for (Triangle& t : surface.mesh.triangles) std::swap(t[1], t[2]);
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

void write_angle_histogram(const MeshMeasures& measures, const std::string& path) {
    PlotOptions options;
    options.title = "Angles of the triangles";
    options.x_label = "angle (°)";
    options.y_label = "angles";
    write_png(
        plot_histogram({measures.angle_histogram.begin(), measures.angle_histogram.end()}, 0, 180, options),
        path);
}

bool has_ending(const std::string& name, const std::string& ending) {
    return name.size() > ending.size() &&
           name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace vdbgeo::app
