// The surface net of a segmentation: vertices in cells, polygons around grid edges between two labels. For
// label_surfaces, and for tetrahedra of labels.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// A vertex of the net, in voxels (indices of the map), and the box that it must not leave.
struct NetVertex {
    Eigen::Vector3f start, low, high;
};

/// Two vertices that share a side of a polygon. A junction is a side that three polygons or more share.
struct NetEdge {
    VertexId a = 0, b = 0;
    bool junction = false;
};

/// The polygon around one grid edge. Counter-clockwise seen from the side of `above`, in indices.
struct NetPolygon {
    static constexpr VertexId none = 0xFFFFFFFFu;
    std::array<VertexId, 4> corner{};
    float below = 0, above = 0;  ///< the labels at the lower and at the upper end of the grid edge
    /// Which of a label's sheets through the corner's cell: two bits a corner, for `below` and for `above`.
    std::uint8_t sheets_below = 0, sheets_above = 0;
    std::int32_t extra = -1;  ///< place in LabelNet::side_vertices; -1: a plain quad
};

struct LabelNet {
    Array<NetVertex> vertices;
    Array<NetEdge> edges;
    Array<NetPolygon> polygons;
    /// Vertices in the middle of a polygon's sides, `none` where there is none: side k runs from corner k.
    std::vector<std::array<VertexId, 4>> side_vertices;
    std::vector<float> labels;  ///< that occur, in order; 0 among them
};

/// Samples outside the box of the map count as 0. `max_shift` and the thickness of the labels give the boxes
/// of the vertices. Throws InvalidInput for samples that are not whole numbers, for an unbounded grid whose
/// background is not 0, and for 2^32 vertices or more.
LabelNet label_net(const DensityMap& map, double max_shift, const Progress& progress);

}  // namespace vdbgeo
