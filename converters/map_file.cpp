#include "converters/map_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "converters/map_parts.h"
#include "converters/map_passes.h"
#include "converters/streamed_grid.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/placement.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;

MapFile read_mrc_map(const fs::path& path, const MapReadOptions& options, const Progress& progress) {
    MapPasses passes(path, options);
    const double before = 1 - 1.0 / passes.passes();
    passes.prepare(progress.part(0, before));
    GridBuilder builder(passes.sorter().size(), passes.sorter().order(), passes.sparsify(), passes.keep());
    std::vector<SortedStrip> slab;
    passes.sort([](SortedStrip&& strip) { return std::move(strip); },
                [&](std::vector<SortedStrip>&& strips) {
                    for (SortedStrip& s : strips) slab.push_back(std::move(s));
                    if (slab.size() < static_cast<std::size_t>(passes.sorter().strips_in_slab())) return;
                    builder.add_slab(std::move(slab));
                    slab.clear();
                },
                progress.part(before, 1));
    MapFile result;
    result.map = builder.finish(passes.source().frame());
    result.rounding = builder.totals().rounding();
    finish_map_file(passes, result);
    return result;
}

void naming_half(const fs::path& path, const RoundingError& error) {
    try {
        check_half_range(error);
    } catch (const InvalidInput& e) {
        throw InvalidInput(path.string() + ": " + e.what());
    }
}

std::string lower_case(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

}  // namespace

MapFile map_of_vdb(const openvdb::FloatGrid::Ptr& grid, const fs::path& path, const MapReadOptions& options) {
    MapFile result;
    if (const auto placement = placement_of(*grid)) {
        undo_placement(*grid);
        result.warnings.push_back(
            fmt::format("it was placed for {}; it is taken back to Å", name_of(placement->program)));
    }
    try {
        result.map = map_from_grid(grid);
    } catch (const InvalidInput& e) {
        throw InvalidInput(fmt::format("{}: grid '{}': {}", path.string(), grid->getName(), e.what()));
    }
    result.level_set = grid->getGridClass() == openvdb::GRID_LEVEL_SET;
    if (options.sparsify.threshold || options.threshold || options.sparsify.background || options.invert ||
        options.crop || options.bin > 1 || options.normalise != MapReadOptions::Normalise::none ||
        options.quantise || options.needs_selection())
        result.warnings.push_back(
            "the grid of a VDB file is taken as it is: nothing was cropped, binned, inverted, scaled, "
            "rounded or dropped");
    if (options.mrc.voxel_size_A || options.mrc.origin != OriginRule::automatic)
        result.warnings.push_back(
            "a VDB file lies where its transform says: neither voxel size nor origin was changed");
    return result;
}

void finish_map_file(MapPasses& passes, MapFile& result) {
    result.warnings = passes.source().warnings();
    if (result.map.statistics.non_finite > 0)
        result.warnings.push_back(fmt::format("{} samples are not finite numbers; they count as empty",
                                              result.map.statistics.non_finite));
    passes.store_metadata(*result.map.grid);
    add_history(*result.map.grid, passes.history());
    result.quantisation = passes.sparsify().quantisation;
    result.notes = passes.notes();
}

MapFile read_map(const fs::path& path, const MapReadOptions& options, const Progress& progress) {
    options.check();
    if (is_map_parts(path)) {
        const MapParts parts(path);
        const openvdb::FloatGrid::Ptr grid = parts.empty_grid();
        parts.copy_to(openvdb::CoordBBox::inf(), grid->tree(), progress);
        return map_of_vdb(grid, path, options);
    }
    if (!is_vdb_file(path)) return read_mrc_map(path, options, progress);
    MapFile result = map_of_vdb(read_vdb(path, options.grid), path, options);
    progress.report(1);
    return result;
}

MapFile stream_map(const fs::path& path, const MapReadOptions& options, const VdbWriteOptions& vdb,
                   const Progress& progress) {
    options.check();
    MapPasses passes(path, options);
    const double before = 1 - 1.0 / passes.passes();
    passes.prepare(progress.part(0, before));
    // The rest of the memory is for the program, the strips at work and the selection.
    const std::uint64_t limit = options.memory_limit(), reserve = limit / 4 + (std::uint64_t(48) << 20);
    const std::uint64_t selection = passes.keep() ? passes.keep()->memUsage() : 0;
    const auto leaves = std::make_shared<PackedLeaves>(
        passes.sorter(), vdb, limit > reserve + selection ? limit - reserve - selection : 0,
        options.scratch.empty() ? fs::temp_directory_path() : options.scratch);
    MapTotals totals;
    struct Packed {
        SortedStrip rest;  // without its blocks
        std::shared_ptr<const PackedLeaves::Row> row;
    };
    passes.sort(
        [&](SortedStrip&& strip) {
            Packed packed;
            packed.row = leaves->pack(strip);
            strip.blocks.clear();
            packed.rest = std::move(strip);
            return packed;
        },
        [&](std::vector<Packed>&& strips) {
            std::vector<std::shared_ptr<const PackedLeaves::Row>> rows;
            for (Packed& p : strips) {
                totals.add(p.rest);
                rows.push_back(std::move(p.row));
            }
            leaves->add_slab(rows);
        },
        progress.part(before, 1));
    const float background = totals.background(passes.sorter());
    if (vdb.half) {
        naming_half(path, leaves->half_error());
        if (std::isinf(rounded_to_half(background)))
            throw InvalidInput(
                fmt::format("{}: the background {} is too large for 16-bit floats; give another --background",
                            path.string(), background));
    }
    MapFile result;
    result.map.grid = std::make_shared<StreamedGrid>(leaves, background);
    result.map.frame = passes.source().frame();
    result.map.statistics = totals.statistics();
    store_frame(result.map);
    finish_map_file(passes, result);
    result.rounding = totals.rounding();
    result.half_error = leaves->half_error();
    if (leaves->spilled() > 0)
        result.notes.push_back(fmt::format("{:.1f} MB of packed leaves went through a temporary file",
                                           static_cast<double>(leaves->spilled()) / 1e6));
    return result;
}

Statistics mrc_statistics(const fs::path& path, const MapReadOptions& options, const Progress& progress) {
    StripSource source(path, options, 1);
    return strip_statistics(source, progress);
}

bool is_map_ending(const fs::path& path) {
    fs::path name = lower_case(path.filename().string());
    if (name.extension() == ".gz" || name.extension() == ".bz2" || name.extension() == ".zst")
        name = name.stem();
    for (const char* ending : {".mrc", ".map", ".ccp4", ".rec", ".st", ".mrcs", ".ali", ".preali", ".msk"})
        if (name.extension() == ending) return true;
    return false;
}

bool is_vdb_ending(const fs::path& path) { return lower_case(path.extension().string()) == ".vdb"; }

}  // namespace vdbgeo
