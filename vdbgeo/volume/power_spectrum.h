// How much of a map there is at which frequency.
#pragma once

#include <cstdint>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

struct PowerSpectrumOptions {
    int largest = 256;   ///< samples along an axis at most, 2…2048; of larger maps the middle is taken
    double taper = 0.1;  ///< part of an axis over which each end falls to 0, 0…0.5

    void check() const;
};

/// Shells of equal width in reciprocal space, from the one around the first frequency along the longest edge
/// of the box up to the Nyquist frequency of the coarsest axis. Empty where no axis has two samples.
struct PowerSpectrum {
    std::vector<double> frequency;     ///< middle of each shell, 1/Å
    std::vector<double> power;         ///< mean of |F|² in it
    std::vector<std::uint64_t> count;  ///< Fourier coefficients in it; shells without any are left out
};

/// The radially averaged power spectrum of the box in the middle of a map, inactive voxels with the values
/// they read as: P(s) = mean over the shell of |Σ w (u − ū) exp(−2πi k·x/N)|² / Σ w², ū the w-weighted mean,
/// w the product of cosine edges along the axes. White noise of variance v has P = v in every shell.
/// Frequencies are those of the map's frame: voxels that are not cubic and skewed cells are right. The box
/// has at most `largest` samples along an axis, rounded down to a product of 2, 3 and 5; without a box (an
/// unbounded frame) it is that of the active voxels. What is not finite counts as ū.
///
/// Memory: 4 bytes a sample of the box. Cost: about 0.1 µs a sample and thread. Same bits for any number of
/// threads. Errors: InvalidInput for bad options; Cancelled.
PowerSpectrum power_spectrum(const DensityMap& map, const PowerSpectrumOptions& options = {},
                             const Progress& progress = {});

}  // namespace vdbgeo
