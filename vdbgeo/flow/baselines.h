// The filters that everybody knows, to compare with: Gaussian, median, bilateral.
#pragma once

#include <openvdb/openvdb.h>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// Normalised Gaussian over the active voxels, Σ g u / Σ g, standard deviation `sigma` in voxels (> 0 … 10.5;
/// 0 gives the input back), cut at 3 sigma and separable where all voxels of the window are active.
void gaussian_filter(openvdb::FloatGrid& grid, double sigma, const Progress& progress = {});

/// Median over the active voxels of the (2r+1)³ window, r 1…8 (0 gives the input back); of an even number, the
/// mean of the middle two.
void median_filter(openvdb::FloatGrid& grid, int radius, const Progress& progress = {});

struct BilateralOptions {
    double sigma = 1.5;  ///< in space, voxels, > 0 … 10.5
    double range = 1;    ///< in density, > 0
    void check() const;
};

/// Σ g_s(|x − y|) g_r(u_x − u_y) u_y / Σ g_s g_r over the active voxels within 2 sigma (Tomasi & Manduchi 1998).
void bilateral_filter(openvdb::FloatGrid& grid, const BilateralOptions& options, const Progress& progress = {});

}  // namespace vdbgeo
