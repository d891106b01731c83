// The labels of a segmentation as regions of space with smooth boundaries.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/surface/label_net.h"
#include "vdbgeo/surface/trilinear_field.h"
#include "vdbgeo/tet/delaunay_tet_mesher.h"
#include "vdbgeo/tet/seeded_tetrahedra.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// The label at a place, in world coordinates. At each voxel every label has a share of the 5³ voxels around,
/// weighted by 2B − B², where B are the binomials 1 2 1 along each axis: a low pass whose second moment is 0,
/// so that it takes away the staircase and does not shrink curved parts to second order (as Taubin's does,
/// SIGGRAPH '95). A place is outside where the background's share, interpolated linearly between the voxels,
/// is larger than that of all labels together, else in the label with the largest share, of equal ones the
/// lower. So regions part space without gaps, and there is no groove where two labels meet at the surface.
///
/// A voxel keeps its label: where it would lose it by d, it gets ahead by max(d, 0.05) instead, so that
/// single voxels and membranes of one voxel stay, some two thirds of a voxel thick. Where all corners of a
/// cell have one label the cell has it too.
///
/// Voxels outside the box are 0. Cost: some 100 ns a question near a boundary, 30 elsewhere; 100 bytes for
/// each cell with two labels.
class LabelDomain final : public TetDomain {
 public:
    /// Takes the wanted labels, or all above 0; others count as 0. Throws InvalidInput for a map that is no
    /// segmentation (is_label_map), for a label that is not there or not 1 to 2^31 − 1, and where there is
    /// none.
    LabelDomain(const DensityMap& map, const std::vector<std::int64_t>& wanted, double tolerance,
                const Progress& progress);

    std::int32_t region(const Vec3d& place) const override;

    /// In order.
    const std::vector<std::int32_t>& labels() const { return labels_; }
    /// The surface net. A part is what is connected of the boundary of one label, the smaller label's where
    /// two meet.
    ReferenceBoundary boundary() const;

 private:
    struct Cell {
        std::uint64_t key;
        std::uint32_t first, count;  // of its labels
    };

    std::int32_t region_of(double sample) const;
    std::int32_t sample(const openvdb::Coord& c) const;
    void choose(const std::vector<std::int64_t>& wanted);
    void make_cells(const Progress& progress);
    void weigh(const openvdb::Coord& c, std::vector<std::int32_t>& labels, std::vector<float>& weights) const;
    const Cell* find(const openvdb::Coord& c) const;

    Frame frame_;
    Mat3d to_index_;
    TrilinearField field_;
    LabelNet net_;
    bool all_ = true;
    std::vector<std::int32_t> labels_;
    std::vector<Cell> cells_;
    std::vector<std::int32_t> slots_;            // open addressing by a cell's key; -1: free
    std::vector<std::int32_t> cell_labels_;      // each cell's, in order
    std::vector<std::array<float, 8>> weights_;  // of each of these at the cell's corners
};

}  // namespace vdbgeo
