#include "converters/map_blocks.h"

#include <fmt/format.h>

#include <limits>
#include <vector>

#include "converters/map_box.h"
#include "converters/map_parts.h"
#include "converters/vdb_sections.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"
#include "vdbgeo/volume/noted_statistics.h"
#include "vdbgeo/volume/placement.h"

namespace vdbgeo {

namespace fs = std::filesystem;
using openvdb::Coord;
using openvdb::CoordBBox;

class MapBlocks::Source {
 public:
    virtual ~Source() = default;
    virtual openvdb::FloatGrid::Ptr read(const CoordBBox& wanted, const Progress& progress) = 0;
    virtual std::uint64_t memory() const = 0;
    virtual bool has_active_beyond_box() const { return false; }

    MapFile whole;
    CoordBBox box;
    std::array<int, 3> order{2, 1, 0};  // of leaves in a tree

 protected:
    void take_box_of_frame() {
        const Vec3i& size = whole.map.frame.size;
        box = {Coord(0), Coord(size.x(), size.y(), size.z()).offsetBy(-1)};
    }
};

namespace {

/// Statistics, background and rounding: what is known only once all samples were seen.
MapTotals find_totals(MapPasses& passes, const Progress& progress) {
    SparsifyOptions nothing;  // keeps no sample
    nothing.threshold = std::numeric_limits<float>::max();
    // What rounding costs is told by the values that are kept.
    const bool rounds = passes.sparsify().quantisation.has_value();
    const StripSorter none(passes.sorter().size(), passes.sorter().order(), nothing);
    const StripSorter& sorter = rounds ? passes.sorter() : none;
    MapTotals totals;
    std::vector<SortedStrip> strips;
    passes.source().pass(
        [&](const Strip& strip, int slab, int row, std::size_t place) {
            strips[place] = sorter.sort(strip, slab, row);
            strips[place].blocks.clear();
        },
        [&](std::size_t count) { strips = std::vector<SortedStrip>(count); },
        [&] {
            for (const SortedStrip& strip : strips) totals.add(strip);
        },
        progress);
    return totals;
}

}  // namespace

class MapBlocks::MrcSource : public Source {
 public:
    MrcSource(const fs::path& path, const MapReadOptions& options, const Progress& progress)
        : passes_(path, options, MapPasses::in_parts) {
        const double before = static_cast<double>(passes_.passes_before()), all = before + 1;
        passes_.prepare(progress.part(0, before / all));
        totals_ = find_totals(passes_, progress.part(before / all, 1));
        order = passes_.sorter().order();
        whole.map = builder().finish(passes_.source().frame(), totals_);
        whole.rounding = totals_.rounding();
        finish_map_file(passes_, whole);
        take_box_of_frame();
    }

    openvdb::FloatGrid::Ptr read(const CoordBBox& wanted, const Progress& progress) override {
        GridBuilder builder = this->builder();
        sort_box(passes_, wanted, builder, {}, progress);
        return builder.finish(whole.map.frame, totals_).grid;
    }

    std::uint64_t memory() const override { return passes_.keep() ? passes_.keep()->memUsage() : 0; }

 private:
    GridBuilder builder() const {
        return {passes_.sorter().size(), passes_.sorter().order(), passes_.sparsify(), passes_.keep()};
    }

    MapPasses passes_;
    MapTotals totals_;
};

/// Leaves that lie in VDB files: VdbSections, or MapParts.
template <class Leaves>
class MapBlocks::VdbSource : public Source {
 public:
    VdbSource(Leaves&& leaves, const fs::path& path, const MapReadOptions& options, const Progress& progress)
        : leaves_(std::move(leaves)) {
        const openvdb::FloatGrid::Ptr grid = leaves_.empty_grid();
        placed_ = placement_of(*grid).has_value();
        const bool noted = noted_statistics(*grid).has_value();
        whole = map_of_vdb(grid, path, options);
        const std::vector<CoordBBox> pieces = leaves_.pieces();
        for (const CoordBBox& piece : pieces) box.expand(piece);
        if (whole.map.frame.bounded()) take_box_of_frame();
        if (!noted) whole.map.statistics = statistics_of(pieces, progress);
    }

    openvdb::FloatGrid::Ptr read(const CoordBBox& wanted, const Progress& progress) override {
        const openvdb::FloatGrid::Ptr grid = leaves_.empty_grid();
        leaves_.copy_to(wanted, grid->tree(), progress);
        if (placed_) undo_placement(*grid);
        return grid;
    }

    std::uint64_t memory() const override { return leaves_.memory(); }

    bool has_active_beyond_box() const override {
        const CoordBBox& active = leaves_.active_box();
        return !active.empty() && !whole_leaves(box).isInside(active);
    }

 private:
    /// As map_from_grid finds them.
    Statistics statistics_of(const std::vector<CoordBBox>& pieces, const Progress& progress) {
        ActiveStatistics all;
        for (std::size_t i = 0; i < pieces.size(); ++i) {
            all.add(*read(pieces[i], {}));
            progress.report(static_cast<double>(i + 1) / static_cast<double>(pieces.size()));
        }
        return all.result();
    }

    Leaves leaves_;
    bool placed_ = false;
};

MapBlocks::MapBlocks(const fs::path& path, const MapReadOptions& options, const Progress& progress)
    : name_(path.string()) {
    options.check();
    std::error_code error;
    if (fs::is_directory(path, error))
        source_ = std::make_unique<VdbSource<MapParts>>(MapParts(path), path, options, progress);
    else if (is_vdb_file(path))
        source_ = std::make_unique<VdbSource<VdbSections>>(VdbSections(path, options.grid), path, options,
                                                           progress);
    else
        source_ = std::make_unique<MrcSource>(path, options, progress);
    progress.report(1);
}

MapBlocks::~MapBlocks() = default;
MapBlocks::MapBlocks(MapBlocks&&) noexcept = default;

const MapFile& MapBlocks::whole() const { return source_->whole; }
const CoordBBox& MapBlocks::box() const { return source_->box; }
const std::array<int, 3>& MapBlocks::order() const { return source_->order; }
std::uint64_t MapBlocks::memory() const { return source_->memory(); }
void MapBlocks::require_active_in_box() const {
    if (!source_->has_active_beyond_box()) return;
    const Vec3i& size = frame().size;
    throw InvalidInput(
        fmt::format("{}: the grid has active voxels outside its box of {} x {} x {}, which cannot be "
                    "done part by part",
                    name_, size.x(), size.y(), size.z()));
}

DensityMap MapBlocks::read(const CoordBBox& wanted, const Progress& progress) const {
    const DensityMap& whole = source_->whole.map;
    DensityMap part{source_->read(wanted, progress), whole.frame, whole.statistics};
    static_cast<openvdb::MetaMap&>(*part.grid) = *whole.grid;
    // Shared: a copy of a transform rounds its scale.
    part.grid->setTransform(std::const_pointer_cast<openvdb::math::Transform>(
        openvdb::FloatGrid::ConstPtr(whole.grid)->constTransformPtr()));
    return part;
}

}  // namespace vdbgeo
