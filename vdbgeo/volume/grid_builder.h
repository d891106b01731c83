// Dense samples, slab by slab → the leaves of a sparse grid.
#pragma once

#include <array>
#include <vector>

#include "vdbgeo/volume/sparsify.h"

namespace vdbgeo {

/// Builds a map from dense sections handed over one slab after another, so that no dense copy of the volume
/// is ever held. Leaves are filled in parallel; the result does not depend on the number of threads.
///
///     GridBuilder builder(size, {0, 1, 2}, options);
///     while (...) builder.add_sections(data, count);       // x fastest, then y
///     DensityMap map = builder.finish(frame);
///
/// Cost: one read of the data, and the kept leaves in memory.
class GridBuilder {
 public:
    /// Hand over this many sections at a time (fewer only in the last call).
    static constexpr int slab = 8;

    /// `size`: samples along x, y, z. `order[0]` is the axis (0 x, 1 y, 2 z) that runs fastest in the data,
    /// `order[2]` the slowest: sections follow one another along it. `keep`: as for StripSorter.
    GridBuilder(const Vec3i& size, const std::array<int, 3>& order, const SparsifyOptions& options = {},
                const openvdb::MaskTree* keep = nullptr);

    /// The next `count` sections. Throws InvalidInput when more come than `size` allows.
    void add_sections(const float* data, int count);

    /// The strips of one slab, from the first row to the last: for a caller that sorts them itself.
    void add_slab(std::vector<SortedStrip>&& strips);
    /// Blocks alone, without what their strips add to the totals: for a part of a map, whose totals come from
    /// elsewhere.
    void add_blocks(std::vector<SortedBlock>&& blocks);
    const StripSorter& sorter() const { return sorter_; }
    const MapTotals& totals() const { return totals_; }

    /// The map, with statistics over all samples handed over; once. Throws InvalidInput when sections are
    /// missing.
    DensityMap finish(const Frame& frame);
    /// The map of the blocks that were handed over, with the totals of the whole.
    DensityMap finish(const Frame& frame, MapTotals& totals);

 private:
    void fill_background(float background);

    StripSorter sorter_;
    MapTotals totals_;
    int slabs_done_ = 0;
    openvdb::FloatGrid::Ptr grid_ = openvdb::FloatGrid::create(StripSorter::unknown_background);
    std::vector<leaf::Leaf*> leaves_;  // owned by the grid's tree
};

}  // namespace vdbgeo
