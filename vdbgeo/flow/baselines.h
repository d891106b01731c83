// The filters that everybody knows, to compare with: Gaussian, median, bilateral.
#pragma once

#include <openvdb/openvdb.h>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

// All three: only active voxels are read and written. InvalidInput for parameters out of range and for values
// that are not finite; Cancelled. The grid is only written to at the end. Memory: 8 bytes a voxel of active
// leaves. The same bits for any number of threads.

/// Normalised Gaussian over the active voxels, Σ g u / Σ g, standard deviation `sigma` in voxels (> 0 … 10.5;
/// 0 gives the input back), cut at the cube of ⌈3 sigma⌉ voxels: three passes, one an axis.
void gaussian_filter(openvdb::FloatGrid& grid, double sigma, const Progress& progress = {});

/// Median over the active voxels of the (2r+1)³ window, r 1…8 (0 gives the input back); of an even number,
/// the mean of the middle two. Cost: by the (2r+1)² voxels that a window's next step takes in.
void median_filter(openvdb::FloatGrid& grid, int radius, const Progress& progress = {});

struct BilateralOptions {
    double sigma = 1.5;  ///< in space, voxels, > 0 … 10.5
    double range = 1;    ///< in density, > 0
    void check() const;
};

/// Σ g_s(|x − y|) g_r(u_x − u_y) u_y / Σ g_s g_r over the active voxels within 2 sigma (Tomasi & Manduchi
/// 1998).
void bilateral_filter(openvdb::FloatGrid& grid, const BilateralOptions& options,
                      const Progress& progress = {});

}  // namespace vdbgeo
