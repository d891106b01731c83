// The statistics in a grid's metadata, and those that take their place where there are none.
#pragma once

#include <openvdb/openvdb.h>

#include <optional>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The statistics that store_frame left in the metadata of a grid, where they are there and make sense.
std::optional<Statistics> noted_statistics(const openvdb::MetaMap& metadata);

/// Those that map_from_grid computes where none were noted, from grids that hold the grid's nodes in the
/// order of its tree.
class ActiveStatistics {
 public:
    void add(const openvdb::FloatGrid& grid);
    Statistics result() const;

 private:
    Statistics sum_;
    double squares_ = 0;  // of deviations from the mean
};

}  // namespace vdbgeo
