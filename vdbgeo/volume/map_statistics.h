// Statistics of a map whose values changed, and how much they did.
#pragma once

#include <vector>

#include "vdbgeo/core/team.h"
#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/sparsify.h"

namespace vdbgeo {

/// Leaves and tiles of a part of a map that members of a team share out: those whose first voxel lies in
/// `own`. No team: all.
struct MapShare {
    Team* team = nullptr;
    openvdb::CoordBBox own;
};

/// The statistics over every sample of a map as it reads now: inside the box the dropped ones too, with their
/// stored value; of a map without a box the active voxels. Leaves are joined line by line along x, so that
/// the bits are the same for any number of threads, and for any team that shares out whole lines. Cost: one
/// pass.
Statistics statistics_of(const DensityMap& map, const MapShare& share = {});

/// The same of a map that comes in parts.
class StatisticsOfParts {
 public:
    explicit StatisticsOfParts(const Frame& frame) : frame_(frame) {}
    /// The leaves and tiles of a part that lie in `own`: all of a line of leaves along x, or nothing of it.
    void add(const openvdb::FloatGrid& part, const openvdb::CoordBBox& own);
    Statistics statistics(float background, Team* team = nullptr) const;

    /// What lies on one line of leaves along x.
    struct Line {
        int y, z;
        Moments moments;
    };
    /// So many voxels of tiles have this value.
    struct TileValue {
        float value;
        std::uint64_t voxels;
    };

 private:
    Frame frame_;
    std::vector<Line> lines_;
    std::vector<TileValue> tiles_;
};

/// Count, mean and squared deviations of the active values alone, likewise.
Moments active_moments(const openvdb::FloatGrid& grid, const MapShare& share = {});

/// √(mean over the active voxels of a of (a − b)²); 0 without any.
double rms_difference(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b);

}  // namespace vdbgeo
