// Dense samples, slab by slab → the leaves of a sparse grid.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Which samples a sparse grid keeps. With neither field set every sample is kept, and going back to a dense
/// file gives the same bits.
struct SparsifyOptions {
    /// Keep samples above this value; the rest reads as the background, and so does what is not finite.
    std::optional<float> threshold;
    /// Keep samples within `band` of `threshold` (which is then the isovalue). What lies above the band is
    /// not active and reads as the band's upper end, so the surface at the isovalue is unchanged.
    std::optional<float> band;
    /// The value of what was dropped: the solvent level, not above the threshold. Unset: the median over the
    /// faces of the box (of about a million of their samples, where there are more), but not above the
    /// threshold (or the band's lower end).
    std::optional<float> background;

    /// Throws InvalidInput when the fields contradict each other.
    void check() const;
};

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
    /// `order[2]` the slowest: sections follow one another along it.
    GridBuilder(const Vec3i& size, const std::array<int, 3>& order, const SparsifyOptions& options = {});
    ~GridBuilder();
    GridBuilder(const GridBuilder&) = delete;
    GridBuilder& operator=(const GridBuilder&) = delete;

    /// The next `count` sections. Throws InvalidInput when more come than `size` allows.
    void add_sections(const float* data, int count);

    /// The map, with statistics over all samples handed over; once. Throws InvalidInput when sections are
    /// missing.
    DensityMap finish(const Frame& frame);

 private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace vdbgeo
