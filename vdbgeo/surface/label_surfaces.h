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
    /// How far a vertex may go from where it began, in voxels along each axis.
    double max_shift = 0.5;

    void check() const;
};

struct LabelSurface {
    std::int64_t label = 0;
    TriMesh mesh;
};

/// Whether a map is a segmentation: every sample a whole number, and few different ones.
bool is_label_map(const DensityMap& map);

/// In the order of the labels. Neighbouring labels share their vertices' positions bit by bit.
std::vector<LabelSurface> label_surfaces(const DensityMap& labels, const LabelSurfacesOptions& options = {},
                                         const Progress& progress = {});

}  // namespace vdbgeo
