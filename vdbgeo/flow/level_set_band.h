// A surface as signed distances on a band of voxels that follows it.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/flow/interpolate.h"
#include "vdbgeo/stencil/tiles.h"

namespace vdbgeo {

/// Signed distances φ (in voxels, negative inside) to a surface, on the voxels nearer to it than `half_width`
/// and their neighbours, and the normals. Operators move φ; `rebuild` makes distances of it again.
class SurfaceBand {
 public:
    static constexpr int min_half_width = 6, max_half_width = 20;

    /// Takes a level set with cubic voxels whose band may be narrower.
    SurfaceBand(const openvdb::FloatGrid& level_set, int half_width, const Progress& progress = {});

    /// Moves the band to where the zero level is now, and makes φ the distance to it: for each voxel the
    /// nearest point of the zero level of the interpolant of order 6, found by Newton's method along the
    /// gradient and across it (Chopp 2001). Where that does not converge (next to a medial axis, in thin
    /// necks) the nearest crossing of an edge of the lattice is taken. The zero level may have moved by a
    /// voxel since the last time.
    void rebuild();

    /// Who is asked, while distances are found, whether to go on.
    void watch(const Progress& progress) { progress_ = progress; }
    bool vanished() const { return vanished_; }
    const stencil::BlockLayout& layout() const { return layout_; }
    const float* phi() const { return phi_.brick(0); }
    float* phi() { return phi_.brick(0); }
    /// Components of the normal ∇φ at the nearest point: that point is x − φ n, as of the last rebuild.
    std::array<const float*, 3> normal() const {
        return {normal_[0].brick(0), normal_[1].brick(0), normal_[2].brick(0)};
    }
    int half_width() const { return half_width_; }
    /// Halo of a tile in which the polynomial at the nearest point of every voxel of the cell can be
    /// evaluated.
    int halo() const { return half_width_ + 5; }

    /// Volume (voxel³) of the inside and area (voxel²) of the surface, from φ being distances: smeared steps
    /// of two widths, put together such that the mean curvature drops out.
    struct Measures {
        double volume = 0, area = 0;
    };
    Measures measures() const;

    /// Writes the surface into a level set as distances in world units, `width` on either side.
    void write(openvdb::FloatGrid& level_set, double width) const;

 private:
    void trim();
    void count_inside();
    void redistance();

    Progress progress_;
    int half_width_;
    bool vanished_ = false;
    openvdb::FloatTree::Ptr tree_;
    stencil::BlockLayout layout_;
    stencil::BlockField phi_;
    std::array<stencil::BlockField, 3> normal_;
    std::uint64_t inside_ = 0;  // inactive voxels with φ < 0
};

/// The field of a tile as a window, with NaN in voxels that are not active, in the tile's scratch array
/// `scratch`.
DenseWindow window_of(const stencil::Tile& tile, std::size_t field, std::size_t scratch);

/// body(x, y, z, at) for the active voxels of the tile's cell.
template <class Body>
void for_active(const stencil::Tile& t, const Body& body) {
    for (int x = 0; x < stencil::BlockLayout::size_x; ++x)
        for (int y = 0; y < stencil::BlockLayout::size_y; ++y) {
            const stencil::RowSpan s = t.span(x, y);
            const int end = s.end < stencil::BlockLayout::size_z ? s.end : stencil::BlockLayout::size_z;
            for (int z = s.begin > 0 ? s.begin : 0; z < end; ++z) {
                const std::ptrdiff_t at = t.at(x, y, z);
                if (t.active[at] != 0) body(x, y, z, at);
            }
        }
}

}  // namespace vdbgeo
