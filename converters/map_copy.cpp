#include "converters/map_copy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "converters/map_passes.h"
#include "converters/mrc_sink.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;

bool is_pipe(const fs::path& out) {
    std::error_code ignored;
    return out == "-" || (fs::exists(out, ignored) && !fs::is_regular_file(out, ignored));
}

bool drops_samples(const MapReadOptions& o) {
    return o.threshold || o.sparsify.threshold || o.needs_selection();
}

/// How often the samples are needed after MapPasses::prepare.
int last_passes(const fs::path& out, const MapReadOptions& read, const MrcWriteOptions& write) {
    return 1 + (is_pipe(out) ? 1 : 0) + (write.scaling == MrcWriteOptions::Scaling::automatic ? 1 : 0) +
           (drops_samples(read) ? 1 : 0);
}

/// What each sample becomes that StripSorter would sort.
class Filter {
 public:
    Filter(const MapPasses& passes, float background)
        : sorter_(passes.sorter()), keep_(passes.keep()), background_(background) {}

    /// `row` starts at `index`; samples follow along the columns' axis.
    void apply(openvdb::Coord index, float* row, std::size_t count) const {
        const SparsifyOptions& o = sorter_.options();
        const int axis = sorter_.order()[0];
        const float low = sorter_.lower_end(), high = sorter_.upper_end();
        for (std::size_t i = 0; i < count; ++i, ++index[axis]) {
            float& v = row[i];
            const bool finite = std::isfinite(v);
            const bool kept = keep_ ? finite && keep_->isValueOn(index) : !o.threshold || (finite && v > low);
            if (!kept)
                v = background_;
            else if (!keep_ && v > high)
                v = high;
            else if (o.quantisation)
                v = quantise(v, *o.quantisation);
        }
    }

 private:
    const StripSorter& sorter_;
    const openvdb::MaskTree* keep_;
    float background_;
};

/// The background and the number of kept voxels: a pass in which nothing is stored.
float find_background(MapPasses& passes, const std::string& name, const Progress& progress) {
    MapTotals totals;
    bool any = false;
    passes.sort(
        [](SortedStrip&& strip) {
            std::pair<SortedStrip, bool> result{SortedStrip(), false};
            for (const SortedBlock& block : strip.blocks)
                if (block.leaf ? !block.leaf->isEmpty() : block.tile == SortedBlock::Tile::kept)
                    result.second = true;
            strip.blocks.clear();
            result.first = std::move(strip);
            return result;
        },
        [&](std::vector<std::pair<SortedStrip, bool>>&& strips) {
            for (auto& [strip, kept] : strips) {
                totals.add(strip);
                any = any || kept;
            }
        },
        progress);
    const Statistics s = totals.statistics();
    if (!any)
        throw NumericalError(fmt::format(
            "{}: no sample is kept: the values lie between {:.6g} and {:.6g}; try another --threshold", name,
            s.min, s.max));
    return totals.background(passes.sorter());
}

/// One pass of all sections through the sink.
void write_pass(MapPasses& passes, const Filter& filter, MrcSink& sink, int height,
                const Progress& progress) {
    const auto& order = passes.sorter().order();
    const Vec3i& size = passes.sorter().size();
    const std::size_t columns = static_cast<std::size_t>(size[order[0]]),
                      rows = static_cast<std::size_t>(size[order[1]]);
    Array<float> slab(columns * rows * static_cast<std::size_t>(height));
    int count = 0;
    passes.source().pass(
        [&](const Strip& strip, int number, int row, std::size_t) {
            openvdb::Coord index;
            for (int s = 0; s < strip.sections; ++s)
                for (int r = 0; r < strip.rows; ++r) {
                    const std::size_t line = static_cast<std::size_t>(row * leaf::dim + r);
                    float* out = slab.data() + (static_cast<std::size_t>(s) * rows + line) * columns;
                    strip.copy_row(s, r, out);
                    index[order[0]] = 0;
                    index[order[1]] = static_cast<int>(line);
                    index[order[2]] = number * height + s;
                    filter.apply(index, out, columns);
                }
            if (row == 0) count = strip.sections;
        },
        [](std::size_t) {}, [&] { sink.write(slab.data(), count); }, progress, height);
}

}  // namespace

MapCopy copy_map(const fs::path& in, const fs::path& out, const MapReadOptions& read,
                 const MrcWriteOptions& write, const Progress& progress) {
    read.check();
    write.check();
    const int last = last_passes(out, read, write);
    MapPasses passes(in, read, last);
    const double share = 1.0 / passes.passes();
    double done = 1 - share * last;
    const auto next = [&] {
        done += share;
        return progress.part(std::max(0.0, done - share), std::min(1.0, done));
    };
    passes.prepare(progress.part(0, done));
    const float background = drops_samples(read) ? find_background(passes, in.string(), next()) : 0;

    openvdb::MetaMap meta;
    passes.store_metadata(meta);
    const auto& order = passes.sorter().order();
    const Vec3i& size = passes.sorter().size();
    MrcSink sink(out, passes.source().frame(), Vec3i::Zero(), recall_mrc_metadata(meta), write);
    const std::uint64_t section = std::uint64_t(4) * static_cast<std::uint64_t>(size[order[0]]) *
                                  static_cast<std::uint64_t>(size[order[1]]);
    const int height =
        static_cast<int>(std::clamp<std::uint64_t>(read.memory_limit() / 8 / section, 1, leaf::dim));
    const Filter filter(passes, background);
    for (int pass = 0; pass < sink.passes(); ++pass) write_pass(passes, filter, sink, height, next());
    MapCopy result;
    result.report = sink.finish();
    result.frame = passes.source().frame();
    result.warnings = passes.source().warnings();
    result.notes = passes.notes();
    return result;
}

}  // namespace vdbgeo
