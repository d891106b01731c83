#include "converters/map_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <future>

#include "converters/vdb_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;

/// Streams all sections of a reader through a builder; one slab is read while the one before is sorted in.
DensityMap stream(MrcReader& reader, const SparsifyOptions& sparsify, bool invert, const Progress& progress) {
    const Vec3i size = reader.frame().size;
    const auto order = reader.order();
    GridBuilder builder(size, order, sparsify);
    const std::size_t section =
        static_cast<std::size_t>(size[order[0]]) * static_cast<std::size_t>(size[order[1]]);
    const int total = reader.sections_left();
    Array<float> slab, next;
    const auto read = [&](Array<float>& into) {
        const int count = std::min(GridBuilder::slab, reader.sections_left());
        into.resize(section * static_cast<std::size_t>(count));  // touched only as far as data arrives
        if (count > 0) reader.read_sections(into.data(), count);
        if (invert)
            for (float& v : into) v = -v;
        return count;
    };
    int count = read(slab);
    for (int done = 0; count > 0;) {
        auto coming = std::async(std::launch::async, read, std::ref(next));
        builder.add_sections(slab.data(), count);
        done += count;
        count = coming.get();
        std::swap(slab, next);
        progress.report(static_cast<double>(done) / total);
    }
    return builder.finish(reader.frame());
}

std::string describe(const fs::path& path, const SparsifyOptions& s, bool invert) {
    std::string line = "read " + path.filename().string();
    if (invert) line += " inverted";
    if (s.threshold && s.band)
        line += fmt::format(" band {} about {}", *s.band, *s.threshold);
    else if (s.threshold)
        line += fmt::format(" threshold {}", *s.threshold);
    if (s.background) line += fmt::format(" background {}", *s.background);
    return line;
}

MapFile read_mrc_map(const fs::path& path, const MapReadOptions& options, const Progress& progress) {
    SparsifyOptions sparsify = options.sparsify;
    double begin = 0;
    if (options.threshold_sigma) {
        if (path == "-")
            throw InvalidInput(
                "standard input: a threshold in sigma reads the map twice, which a pipe does not allow; give "
                "a "
                "value");
        const Statistics s = mrc_statistics(path, options, progress.part(0, 0.5));
        sparsify.threshold = static_cast<float>(s.mean + *options.threshold_sigma * s.rms);
        begin = 0.5;
    }
    MrcReader reader(path, options.mrc);
    MapFile result;
    result.map = stream(reader, sparsify, options.invert, progress.part(begin, 1));
    result.warnings = reader.warnings();
    if (result.map.statistics.non_finite > 0)
        result.warnings.push_back(fmt::format("{} samples are not finite numbers; they count as empty",
                                              result.map.statistics.non_finite));
    store_mrc_metadata(*result.map.grid, reader, path.filename().string());
    add_history(*result.map.grid, describe(path, sparsify, options.invert));
    return result;
}

std::string lower_case(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

}  // namespace

void MapReadOptions::check() const {
    mrc.check();
    sparsify.check();
    if (threshold_sigma && !std::isfinite(*threshold_sigma))
        throw InvalidInput("the threshold is not a finite number");
    if (threshold_sigma && sparsify.threshold)
        throw InvalidInput("two thresholds, one in sigma and one as a value");
}

MapFile read_map(const fs::path& path, const MapReadOptions& options, const Progress& progress) {
    options.check();
    if (!is_vdb_file(path)) return read_mrc_map(path, options, progress);
    MapFile result;
    const auto grid = read_vdb(path, options.grid);
    try {
        result.map = map_from_grid(grid);
    } catch (const InvalidInput& e) {
        throw InvalidInput(fmt::format("{}: grid '{}': {}", path.string(), grid->getName(), e.what()));
    }
    result.level_set = grid->getGridClass() == openvdb::GRID_LEVEL_SET;
    if (options.sparsify.threshold || options.threshold_sigma || options.invert)
        result.warnings.push_back(
            "the grid of a VDB file is taken as it is: neither threshold nor inversion was applied");
    progress.report(1);
    return result;
}

Statistics mrc_statistics(const fs::path& path, const MapReadOptions& options, const Progress& progress) {
    MrcReader reader(path, options.mrc);
    return mrc_statistics(reader, options.invert, progress);
}

Statistics mrc_statistics(MrcReader& reader, bool invert, const Progress& progress) {
    SparsifyOptions nothing;  // keeps no sample: only the statistics are wanted
    nothing.threshold = std::numeric_limits<float>::max();
    return stream(reader, nothing, invert, progress).statistics;
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
