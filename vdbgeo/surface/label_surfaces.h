// Smooth closed surfaces of a segmentation, one a label.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct LabelSurfacesOptions {
    /// The labels to extract; empty: all but 0, which is the background.
    std::vector<std::int64_t> labels;
    /// Rounds of smoothing; 0 leaves the staircase.
    int iterations = 60;
    /// How far a vertex may go from the middle of its cell, in voxels along each axis; above 0, at most 2. Up
    /// to ½ no sheet can reach another one. Labels that were enlarged from larger voxels have larger steps,
    /// and need half of those; sheets may then cross where a label is thin.
    double max_shift = 0.5;

    void check() const;
};

struct LabelSurface {
    std::int64_t label = 0;
    TriMesh mesh;
};

/// Whether a map is a segmentation: every sample a whole number, some of them not 0, at most 65536 different
/// ones; and of the neighbours along z that are both not 0, three quarters equal, which tells labels from
/// densities that were stored as whole numbers. Reads the leaves once, and up to the first sample that is not
/// whole.
bool is_label_map(const DensityMap& map);

/// One closed, oriented 2-manifold for each label of a segmentation, normals outward, in Å; in the order of
/// the labels.
///
/// Surface nets (Gibson, MICCAI 1998; for many labels Frisken, JCGT 11 (2022)): a vertex in each cell between
/// 2³ samples that are not all alike, one for each sheet of surface through the cell; a polygon of four such
/// around each grid edge between two labels. The whole net is smoothed at once (Taubin, SIGGRAPH '95: without
/// shrinking), every vertex within a box about its cell's middle, and then cut into labels: neighbouring
/// labels share positions bit by bit, and the diagonals of their quads (the shorter ones). Vertices between
/// three labels or more are smoothed along the lines where these meet. Outside its box the map is 0, so that
/// every surface is closed, and flat there.
///
/// Voxels of a label that share a face are connected, and those that share an edge too, by a neck through two
/// vertices more in each cell face, unless the other two at the edge have one common label that goes first
/// (of two labels the smaller one, 0 last). What is one voxel thick keeps at least half of it, a single
/// voxel stays as a blob. Where three labels or more meet in a cell, two sheets of one label may touch in a
/// vertex; only there do surfaces intersect themselves (about one triangle in ten thousand of a whole
/// tomogram's labels).
///
/// Cost: in proportion to the leaves and to the surface, about 1 µs a triangle; some 150 bytes a triangle for
/// the net. The same bytes for any number of threads. Throws InvalidInput for samples that are not whole
/// numbers, a label that no voxel has, an unbounded grid whose background is not 0, and 2^32 vertices or
/// more; Cancelled.
std::vector<LabelSurface> label_surfaces(const DensityMap& labels, const LabelSurfacesOptions& options = {},
                                         const Progress& progress = {});

}  // namespace vdbgeo
