// Planes of a tile, with a halo, from bricks and back.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "vdbgeo/stencil/block_layout.h"
#include "vdbgeo/stencil/plane_kernels.h"

namespace vdbgeo::stencil {

/// A run of cells along x with a halo on all sides, seen plane by plane: rows of z, one for each y from the
/// run's first voxel − halo on. A row begins and ends with as many whole leaves as the halo reaches into, so
/// that all rows start on a cache line and leaves are copied in whole rows. Move to a plane, then copy. What
/// the layout does not work on is there as far as the halo around the rest reaches; further out the plane is
/// not touched, and spans are empty.
class TileGather {
 public:
    /// halo: 0…BlockLayout::max_halo voxels.
    TileGather(const BlockLayout& layout, BlockLayout::Run run, int halo);

    static int rows_of(int halo) { return BlockLayout::size_y + 2 * halo; }
    /// Voxels in a row before the run's first.
    static int lead_of(int halo) { return (halo + 7) / 8 * 8; }
    static int stride_of(int halo) {
        return (BlockLayout::size_z + 2 * lead_of(halo) + lanes - 1) / lanes * lanes;
    }
    /// x of the first voxel that is worked on, and behind the last: planes may be moved to from begin − halo
    /// on.
    int x_begin() const { return work_.min().x(); }
    int x_end() const { return work_.max().x() + 1; }
    /// y of these, counted from the run's first voxel.
    int y_begin() const { return work_.min().y() - origin_.y(); }
    int y_end() const { return work_.max().y() + 1 - origin_.y(); }
    const openvdb::Coord& origin() const { return origin_; }

    void move_to(int x);
    /// The plane of a field; `absent` where there is no leaf, or what the plane had there.
    void copy(const float* bricks, std::optional<float> absent, float* plane) const;
    /// `on` where voxels are active, `off` elsewhere.
    void activity(float on, float off, float* plane) const;
    /// The active part of each row.
    void spans(RowSpan* rows);
    /// Writes the plane, without its halo, into the bricks of the run that are worked on. End with
    /// Kernels::finish_writing.
    void scatter(const float* plane, float* bricks) const;

 private:
    static constexpr int most = 4;  // leaves of the widest halo
    struct Part {                   // what of the leaves in one line of y or z belongs to the tile
        int leaf, from, to,
            at;    // leaf number from the cell's first; voxels [from, to) of it; place in the plane
        bool own;  // some of it is worked on
    };
    static int parts(int begin, int end, int halo, int lead, Part* out);
    void find_spans(RowSpan* rows) const;
    void find_bricks(int layer, std::int32_t* out) const;
    template <class Body>
    void for_leaves(const Body& body) const;

    const BlockLayout& layout_;
    BlockLayout::Run run_;
    int halo_, x_ = 0, layer_ = std::numeric_limits<int>::min() / 2;
    std::ptrdiff_t stride_;
    openvdb::Coord origin_;
    openvdb::CoordBBox work_;
    Part y_[BlockLayout::leaves_y + 2 * most], z_[BlockLayout::leaves_z + 2 * most];
    int y_count_, z_count_;
    /// Every leaf of the layer is full or missing: its planes have the same spans.
    bool regular_ = false, spans_known_ = false;
    std::array<RowSpan, BlockLayout::size_y + 2 * BlockLayout::max_halo> regular_spans_;
    const Kernels& kernels_;
    using Bricks = std::int32_t[(BlockLayout::leaves_y + 2 * most) * (BlockLayout::leaves_z + 2 * most)];
    Bricks bricks_, next_bricks_;  // of this layer of leaves along x, and of the one after it
};

}  // namespace vdbgeo::stencil
