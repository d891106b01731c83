#include "apps/block_filter.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "apps/map_output.h"
#include "apps/reports.h"
#include "apps/stages.h"
#include "converters/leaf_source.h"
#include "converters/map_blocks.h"
#include "converters/map_parts.h"
#include "converters/mrc_metadata.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/freed_memory.h"
#include "vdbgeo/flow/diffusion_fields.h"
#include "vdbgeo/volume/leaf_layout.h"
#include "vdbgeo/volume/map_statistics.h"

namespace vdbgeo::app {
namespace {

using openvdb::CoordBBox;
using openvdb::FloatGrid;

constexpr std::uint64_t megabyte = std::uint64_t(1) << 20;

std::filesystem::path scratch_of(const MapFilterFlags& flags) {
    const std::filesystem::path& given = flags.map.options.scratch;
    return given.empty() ? std::filesystem::absolute(flags.out).parent_path() : given;
}

/// What reading may take of the memory: strips of the file.
MapReadOptions reading(const MapFilterFlags& flags) {
    MapReadOptions out = flags.map.options;
    out.memory = std::max(out.memory_limit() / 4, 64 * megabyte);
    out.scratch = scratch_of(flags);
    return out;
}

/// What is left of the memory for blocks: the program itself, strips of the file and nodes of trees that come
/// and go take the rest.
std::uint64_t memory_for_blocks(std::uint64_t limit, std::uint64_t held) {
    const std::uint64_t taken = 128 * megabyte + held + limit / 6;
    return limit > taken ? limit - taken : 0;
}

/// A map that is read, changed and written block by block.
class BlockFilter {
 public:
    /// Opens the map and says what is odd about it.
    BlockFilter(const MapFilterFlags& flags, Session& session);

    const MapFile& in() const { return map_.whole(); }
    MapSource source() const;
    BlockOptions options() const;
    /// NumericalError: no sample is kept.
    [[noreturn]] void fail_empty() const;
    /// Takes for the map's values those of a result, which has to live as long.
    void finish(const BlockedResult& made, bool cleared, const std::string& history);
    /// Writes the map and puts its statistics, and what there is to say of the file, into the result.
    void write(Json& result, Session& session);
    /// Of the new values, once they are written, and the sum of the squares of what changed.
    const Statistics& statistics() const { return result_.statistics; }
    const ExactSum& squared_change() const { return squared_change_; }

 private:
    Statistics statistics_by_slabs(const Progress& progress) const;
    FloatGrid::Ptr changed(const CoordBBox& slab, ExactSum& squares) const;

    const MapFilterFlags& flags_;
    MapBlocks map_;
    DensityMap result_;  // without voxels
    const BlockedResult* made_ = nullptr;
    bool cleared_ = false;
    ExactSum squared_change_;
};

BlockFilter::BlockFilter(const MapFilterFlags& flags, Session& session)
    : flags_(flags), map_(flags.in, reading(flags), session.stage("opening")) {
    session.end_stage();
    if (!map_.frame().bounded())
        throw InvalidInput(flags.in +
                           ": the grid has no box, which blocks of it need; vdbgeo convert makes one");
    map_.require_active_in_box();
    for (const std::string& w : in().warnings) session.warn(flags.in + ": " + w);
    if (!session.json && !session.quiet)
        for (const std::string& note : in().notes) session.say(flags.in + ": " + note);
}

MapSource BlockFilter::source() const {
    return {map_.box(), in().map.grid->constTransformPtr(),
            [this](const CoordBBox& box) { return map_.read(box).grid; }};
}

BlockOptions BlockFilter::options() const {
    BlockOptions out;
    out.memory = memory_for_blocks(flags_.map.options.memory_limit(), map_.memory());
    out.scratch = scratch_of(flags_);
    return out;
}

void BlockFilter::fail_empty() const {
    need_samples(flags_.in, Moments(), map_.statistics());
    throw NumericalError(flags_.in + ": no sample is kept");
}

FloatGrid::Ptr BlockFilter::changed(const CoordBBox& slab, ExactSum& squares) const {
    FloatGrid::Ptr part = map_.read(slab).grid;
    if (part->tree().hasActiveTiles()) part->tree().voxelizeActiveTiles();
    squares.add(made_->store(slab, part->tree()));
    if (cleared_) clear_inactive(*part);
    return part;
}

void BlockFilter::finish(const BlockedResult& made, bool cleared, const std::string& history) {
    made_ = &made;
    cleared_ = cleared;
    result_ = in().map;
    result_.grid = in().map.grid->copyWithNewTree();
    // Shared: a copy of a transform rounds its scale.
    result_.grid->setTransform(in().map.grid->transformPtr());
    if (cleared) clear_inactive(*result_.grid);
    note_new_values(result_, history);
}

/// Slabs along z hold whole lines of leaves along x.
Statistics BlockFilter::statistics_by_slabs(const Progress& progress) const {
    StatisticsOfParts all(result_.frame);
    CoordBBox slab = map_.box();
    const int begin = slab.min().z() / leaf::dim * leaf::dim, end = slab.max().z();
    for (int z = begin; z <= end; z += leaf::dim) {
        slab.min().z() = z;
        slab.max().z() = z + leaf::dim - 1;
        ExactSum counted_before;
        all.add(*changed(slab, counted_before), slab);
        progress.report(double(z - begin + leaf::dim) / double(end - begin + leaf::dim));
    }
    return all.statistics(result_.grid->background());
}

void BlockFilter::write(Json& result, Session& session) {
    const bool vdb = has_ending(flags_.out, ".vdb");
    LeafSource leaves;
    leaves.frame = result_.frame;
    leaves.meta = static_cast<const openvdb::MetaMap&>(*result_.grid);
    leaves.transform = result_.grid->constTransformPtr();
    leaves.background = result_.grid->background();
    leaves.active_box = map_.box();
    const int axis = vdb ? 2 : recall_mrc_metadata(leaves.meta).order[2];
    // Statistics are found on the way where slabs lie along z. Some outputs ask for a slab more than once.
    StatisticsOfParts all(result_.frame);
    int next = map_.box().min()[axis] / leaf::dim * leaf::dim;
    leaves.finder = slab_finder(axis, map_.box(), [&](const CoordBBox& slab) {
        ExactSum squares;
        FloatGrid::Ptr part = changed(slab, squares);
        if (slab.min()[axis] == next) {
            squared_change_.add(squares);
            if (axis == 2) all.add(*part, slab);
            next += leaf::dim;
        }
        return part;
    });
    leaves.finish_meta = [&](openvdb::MetaMap& meta) {
        result_.statistics = all.statistics(leaves.background);
        store_frame(result_);
        meta = *result_.grid;
    };
    give_memory_back();  // what the blocks took
    std::optional<MrcWriteReport> report;
    const Progress progress = session.stage("writing");
    if (vdb) {
        write_vdb(leaves, flags_.out, flags_.vdb, options().memory / 2, scratch_of(flags_), progress);
    } else {
        report = write_mrc(leaves, flags_.out, flags_.mrc, progress);
        result_.statistics =
            axis == 2 ? all.statistics(leaves.background) : statistics_by_slabs(session.stage("statistics"));
    }
    session.end_stage();
    result.update(statistics_json(result_.statistics));
    if (report) report_written(flags_.out, *report, result, session);
}

}  // namespace

bool in_blocks(const MapFilterFlags& flags, const MemoryNeed& need) {
    const MapReadOptions& options = flags.map.options;
    if (flags.in == "-") return false;
    if (is_map_parts(flags.in)) return true;
    const auto samples = samples_in_file(flags, options.memory.has_value());
    return samples && *samples * need.bytes_a_voxel > static_cast<double>(options.memory_limit()) &&
           memory_for_blocks(options.memory_limit(), 0) > 0;
}

BlockedOutcome filter_in_blocks(const MapFilterFlags& flags, const BlockedCommand& command,
                                Session& session) {
    give_large_memory_back_at_once();
    BlockedOutcome out;
    Clock clock;
    BlockFilter filter(flags, session);
    need_density(flags.in, filter.in());
    out.seconds["read"] = clock.lap();
    BlockOptions blocks = filter.options();
    const auto compute = [&] {
        return naming(flags.in, [&] {
            return command.compute(filter.source(), blocks, out.report, session.stage(command.stage));
        });
    };
    if (command.checkpoints) blocks.checkpoint = command.checkpoints->options;
    const auto made = command.checkpoints ? command.checkpoints->run(session, compute) : compute();
    if (!made) filter.fail_empty();
    filter.finish(*made, command.cleared, command.history(out.report));
    out.seconds["compute"] = clock.lap();
    out.result = filter_result(flags, filter.in());
    filter.write(out.result, session);
    out.seconds["write"] = clock.lap();
    if (command.checkpoints) command.checkpoints->remove(session);
    out.report.removed = root_mean_square(filter.squared_change(), out.report.active_voxels);
    out.statistics = filter.statistics();
    out.deviation = std::sqrt(made->before().variance());
    return out;
}

}  // namespace vdbgeo::app
