// The trilinear interpolant of a sparse grid at any place, fast. For what meshes a map as a function of
// place.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// u(x) − isovalue, where u is the trilinear interpolant of a map's samples and x is in index units: at or
/// above 0 inside. The map is the function that marching_cubes reads: active voxels, inactive voxels and
/// tiles alike, outside the box of a bounded frame nothing (−∞); an unbounded grid goes on as background. The
/// isovalue is taken as a 32-bit float.
///
/// Samples that equal the isovalue count as inside and are raised by 1/1024 of the isovalue's height above
/// the map's minimum, so that a voxel which just reaches it has an inside of some size, as marching cubes
/// gives it. A sample that is not a number is empty: −∞ wherever it has a weight above 1/1024.
///
/// Queries may come from any thread. One costs some 20 ns: a hash over the grid's 128³ nodes, a table of each
/// one's leaves. The grid must not change meanwhile.
class TrilinearField {
 public:
    TrilinearField(const DensityMap& map, double isovalue);

    double operator()(const Vec3d& index) const {
        Cursor cursor;
        return (*this)(index, cursor);
    }

    /// The corners of the cell of the last query: queries near each other need not look for them again.
    class Cursor {
        friend class TrilinearField;
        openvdb::Coord cell_ = openvdb::Coord::max();
        std::array<double, 8> corners_;
    };
    double operator()(const Vec3d& index, Cursor& cursor) const;

    /// The sample at a voxel as the grid stores it, outside the box too.
    double value(const openvdb::Coord& c) const;

 private:
    static constexpr int node_dim = 16;  // blocks along an edge of a node
    static constexpr int node_bits = 7;  // of a voxel's place in its node
    struct Node {
        openvdb::Coord origin;
        std::vector<const float*> samples;  // per block, its leaf's values, null for a tile
        std::vector<float> tile;
    };
    using Corners = std::array<double, 8>;

    const Node* find(const openvdb::Coord& c) const;
    Corners corners(const openvdb::Coord& c) const;
    static double without_nan(const Corners& d, const Vec3d& t);

    openvdb::FloatTree::ConstPtr tree_;
    Frame frame_;
    double isovalue_, lift_;
    std::vector<Node> nodes_;
    std::vector<std::int32_t> slots_;  // open addressing by a node's origin; -1: free
};

}  // namespace vdbgeo
