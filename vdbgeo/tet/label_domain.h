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

/// The label at a place, in world coordinates. Every label L has a weight s_L at each voxel: the share of L
/// among the 5³ voxels around, weighted by the binomials 1 4 6 4 1 along each axis (a Gaussian of one voxel),
/// which takes away the staircase. A voxel keeps its label: where another one's weight m is larger by d, its
/// own becomes m + max(d, 0.05), so that single voxels and membranes of one voxel stay, some 0.8 and 0.7
/// voxels thick. Between the voxels weights are interpolated linearly, and the largest wins, of equal ones
/// the lower label. So the regions part space without gaps, and where all corners of a cell have one label
/// the cell has it too.
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
