#include "converters/map_part.h"

#include <algorithm>
#include <tuple>

#include "converters/map_blocks.h"
#include "converters/map_box.h"
#include "converters/map_parts.h"
#include "converters/vdb_sections.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

/// What a strip adds to the totals of a map, and where it lies in the file.
struct StripTotal {
    int slab, row;
    Moments moments;
    RoundingError rounding;
    std::uint64_t border;  // samples of the border, which follow apart
};

/// The totals of the strips that members own, put together in file order.
class TotalsOfAll {
 public:
    void add(int slab, int row, const SortedStrip& strip) {
        strips_.push_back({slab, row, strip.moments, strip.rounding, strip.border.size()});
        border_.insert(border_.end(), strip.border.begin(), strip.border.end());
    }

    MapTotals gather(Team& team) const {
        const std::vector<StripTotal> strips = gather_all(team, strips_);
        const std::vector<float> border = gather_all(team, border_);
        struct Place {
            const StripTotal* strip;
            const float* border;
        };
        std::vector<Place> places;
        const float* at = border.data();
        for (const StripTotal& s : strips) {
            places.push_back({&s, at});
            at += s.border;
        }
        std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
            return std::tie(a.strip->slab, a.strip->row) < std::tie(b.strip->slab, b.strip->row);
        });
        MapTotals totals;
        for (const Place& p : places) {
            SortedStrip strip;
            strip.moments = p.strip->moments;
            strip.rounding = p.strip->rounding;
            strip.border.assign(p.border, p.border + p.strip->border);
            totals.add(strip);
        }
        return totals;
    }

 private:
    std::vector<StripTotal> strips_;
    std::vector<float> border_;
};

MapFile read_mrc_part(const std::filesystem::path& path, const MapReadOptions& options, const MapPart& part,
                      const Progress& progress) {
    MapPasses passes(path, options);
    const double before = 1 - 1.0 / passes.passes();
    passes.prepare(progress.part(0, before));
    const auto order = passes.sorter().order();
    GridBuilder builder(passes.sorter().size(), order, passes.sparsify(), passes.keep());
    TotalsOfAll totals;
    const auto add_own = [&](int slab, int row, const SortedStrip& strip) {
        Coord first;  // of the strip's first block
        first[order[1]] = row * leaf::dim;
        first[order[2]] = slab * leaf::dim;
        if (part.own.isInside(first)) totals.add(slab, row, strip);
    };
    sort_box(passes, part.wanted, builder, add_own, progress.part(before, 1));
    MapTotals all = totals.gather(*part.team);
    MapFile result;
    result.rounding = all.rounding();
    result.map = builder.finish(passes.source().frame(), all);
    finish_map_file(passes, result);
    return result;
}

/// A grid in a VDB file, or in several that are its parts.
bool holds_grid(const std::filesystem::path& path) { return is_map_parts(path) || is_vdb_file(path); }

openvdb::FloatGrid::Ptr empty_grid(const std::filesystem::path& path, const MapReadOptions& options) {
    return is_map_parts(path) ? MapParts(path).empty_grid() : VdbSections(path, options.grid).empty_grid();
}

MapFile part_of_grid(const std::filesystem::path& path, const MapReadOptions& options, const MapPart& part,
                     const Progress& progress) {
    const MapBlocks map(path, options);
    if (!part.box_only) map.require_active_in_box();
    MapFile result = map.whole();
    result.map = map.read(part.wanted, progress);
    openvdb::FloatTree& tree = result.map.grid->tree();
    if (tree.hasActiveTiles()) tree.voxelizeActiveTiles();
    return result;
}

}  // namespace

Frame map_frame(const std::filesystem::path& path, const MapReadOptions& options) {
    options.check();
    if (!holds_grid(path)) return StripSource(path, options, 1).frame();
    const Frame frame = map_of_vdb(empty_grid(path, options), path, options).map.frame;
    if (!frame.bounded())
        throw InvalidInput(path.string() +
                           ": the grid has no box, which parts of it need; vdbgeo convert makes one");
    return frame;
}

MapFile read_map_part(const std::filesystem::path& path, const MapReadOptions& options, const MapPart& part,
                      const Progress& progress) {
    options.check();
    if (path == "-") throw InvalidInput("-: parts are read from a file, not from a pipe");
    return holds_grid(path) ? part_of_grid(path, options, part, progress)
                            : read_mrc_part(path, options, part, progress);
}

}  // namespace vdbgeo
