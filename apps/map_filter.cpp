#include "apps/map_filter.h"

#include <fmt/format.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>

#include "apps/map_output.h"
#include "apps/stages.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/derived_grid.h"
#include "vdbgeo/volume/leaf_layout.h"
#include "vdbgeo/volume/map_statistics.h"

namespace vdbgeo::app {
namespace {

std::string size_text(double bytes) {
    return bytes < 1e9 ? fmt::format("{:.0f} MB", std::ceil(bytes / 1e6))
                       : fmt::format("{:.1f} GB", bytes / 1e9);
}

void check_memory(const MapFilterFlags& flags, const MemoryNeed& need, double voxels,
                  const char* what_to_try) {
    const double bytes = voxels * need.bytes_a_voxel;
    const auto given = static_cast<double>(flags.map.options.memory_limit());
    if (bytes > given)
        throw NumericalError(
            fmt::format("{}: {} takes about {}, and {} may be taken{}; try {}, or a larger --memory",
                        flags.in, need.doing, size_text(bytes), size_text(given),
                        flags.map.options.memory ? " (--memory)" : ", half of the machine's", what_to_try));
}

/// Voxels in the leaves that have active ones, once tiles are leaves too.
double voxels_in_leaves(const openvdb::FloatGrid& grid) {
    double voxels = static_cast<double>(grid.constTree().leafCount()) * leaf::size;
    auto tile = grid.constTree().cbeginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) voxels += static_cast<double>(tile.getVoxelCount());
    return voxels;
}

}  // namespace

std::optional<double> samples_in_file(const MapFilterFlags& flags, bool all) {
    const MapReadOptions& o = flags.map.options;
    if (flags.in == "-" || is_vdb_file(flags.in)) return {};
    if (!all && (o.threshold || o.sparsify.threshold || o.needs_selection())) return {};
    const Vec3i size = MrcReader(flags.in, o.mrc).frame().size;
    double samples = 1;
    for (int a = 0; a < 3; ++a) {
        int n = size[a];
        if (o.crop) {
            const auto axis = static_cast<std::size_t>(a);
            n = std::min(n, o.crop->end[axis].value_or(n)) - o.crop->begin[axis].value_or(0);
        }
        samples *= std::max(1, n / o.bin);
    }
    return samples;
}

void MapFilterFlags::add(CLI::App& app, const std::string& out_text) {
    app.add_option("in", in, "Map (MRC, CCP4; - reads one from a pipe) or VDB grid")->required();
    app.add_option("out", out, out_text)->required();
    map.add_reading(app);
    map.add_sparsify(app);
    map.add_memory(app);
    app.add_option("--scratch", map.options.scratch,
                   "Folder for what does not fit into the memory, for as long as it takes [that of OUT]");
    add_vdb_flags(app, vdb);
    app.add_option("--mode", mrc.mode, "MRC mode to write: 0, 1, 2, 6, 12 or 101 [2]");
    add_map_output_flags(app, mrc);
}

void MapFilterFlags::add_preview(CLI::App& app, const std::string& text) {
    app.add_option("--preview", preview, text);
}

void MapFilterFlags::finish() {
    map.finish();
    check_usage(mrc);
    if (!preview.empty() && !has_ending(preview, ".png"))
        throw UsageError(fmt::format("{}: a preview is a .png file", preview));
}

MapFile read_for_filter(const MapFilterFlags& flags, const MemoryNeed& need, Session& session) {
    const char* fewer = "--bin 2, --crop or --threshold";
    if (const auto samples = samples_in_file(flags, false)) check_memory(flags, need, *samples, fewer);
    MapFile in = read_map(flags.in, flags.map.options, session.stage("reading"));
    need_samples(flags.in, active_moments(*in.map.grid), in.map.statistics);
    check_memory(flags, need, voxels_in_leaves(*in.map.grid),
                 flags.in != "-" && is_vdb_file(flags.in) ? "a grid with fewer active voxels" : fewer);
    for (const std::string& w : in.warnings) session.warn(flags.in + ": " + w);
    if (!session.json && !session.quiet)
        for (const std::string& note : in.notes) session.say(flags.in + ": " + note);
    return in;
}

void need_samples(const std::string& name, const Moments& kept, const Statistics& of_map) {
    if (kept.non_finite > 0)
        throw InvalidInput(fmt::format(
            "{}: {} of the samples are not finite numbers; --threshold or --mask can leave them out", name,
            kept.non_finite));
    if (kept.count == 0)
        throw NumericalError(fmt::format(
            "{}: no sample is kept: the values lie between {:.6g} and {:.6g}; try another --threshold", name,
            of_map.min, of_map.max));
}

void need_density(const std::string& name, const MapFile& in) {
    if (in.level_set)
        throw InvalidInput(fmt::format(
            "{}: the grid is a level set, not a density; vdbgeo flow --surface smooths it", name));
}

void finish_map(DensityMap& map, const std::string& history) {
    map.statistics = statistics_of(map);
    note_new_values(map, history);
}

void note_new_values(DensityMap& map, const std::string& history) {
    if (map.grid->getMetadata<openvdb::Int32Metadata>("mrc_mode"))
        set_metadata(*map.grid, "mrc_mode", std::int32_t(2));  // whole numbers do not hold the new values
    store_frame(map);
    add_history(*map.grid, history);
}

void write_filtered(const MapFilterFlags& flags, const DensityMap& map, Json& result, Session& session) {
    const auto report = write_map(map, flags.out, flags.vdb, flags.mrc, session.stage("writing"));
    session.end_stage();
    if (report) report_written(flags.out, *report, result, session);
}

Json filter_result(const MapFilterFlags& flags, const MapFile& in) {
    return {{"in", flags.in}, {"out", flags.out}, {"warnings", in.warnings}, {"notes", in.notes}};
}

void clear_inactive(openvdb::FloatGrid& grid) {
    openvdb::FloatTree& tree = grid.tree();
    tree.root().setBackground(0, false);
    openvdb::tree::LeafManager<openvdb::FloatTree> leaves(tree);
    parallel_for(leaves.leafCount(), 64, [&](std::size_t i) {
        auto& leaf = leaves.leaf(i);
        if (!leaf.isDense())
            for (auto it = leaf.beginValueOff(); it; ++it) it.setValue(0);
    });
    auto tile = tree.beginValueOff();
    tile.setMaxDepth(openvdb::FloatTree::ValueOffIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) tile.setValue(0);
}

}  // namespace vdbgeo::app
