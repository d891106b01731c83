// Which level of a map is its surface.
#pragma once

#include <string>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// A level as a user gives it: a number in the map's units, or a rule that takes it from the map.
struct Isovalue {
    enum class Rule {
        automatic,  ///< by the class of the grid: 0 for a level set, half the maximum for a fog volume, else
                    ///< mean + 3 rms over all samples of the map
        value,      ///< `number`
        sigma,      ///< mean + `number` · rms over all samples of the map
        volume,     ///< the voxels at or above the level fill `number` Å³
        mass,       ///< the same for a molecule of `number` Da: volume = A3_per_dalton · mass
        otsu        ///< parts the samples in two classes that differ most (Otsu 1979)
    };

    /// Å³ that a dalton of protein takes: its density is 0.81 Da/Å³, 1.35 g/cm³.
    static constexpr double A3_per_dalton = 1.23;

    Rule rule = Rule::automatic;
    double number = 0;

    /// "auto", "0.7", "3sigma", "volume:250000" (Å³), "mass:800kDa" (Da, kDa or MDa; a bare number is Da),
    /// "otsu". Throws InvalidInput for anything else.
    static Isovalue parse(const std::string& text);
    /// The inverse of parse.
    std::string text() const;

    /// Whether the rule looks at the samples themselves: volume, mass and otsu.
    bool needs_samples() const { return rule == Rule::volume || rule == Rule::mass || rule == Rule::otsu; }

    /// The level for a map with these statistics in a grid of this class. Throws InvalidInput where the map
    /// has no finite sample to take statistics of, and for a rule that needs the samples.
    double resolve(const Statistics& statistics, openvdb::GridClass grid_class = openvdb::GRID_UNKNOWN) const;

    /// The level for this map, by any rule. The samples are all those inside the box, dropped ones with the
    /// value that they read as; of a grid without a box the active voxels.
    ///
    /// Volume and mass: exact. n = volume / voxel volume, rounded; the level lies half-way between the n-th
    /// and the (n+1)-th highest sample, so that n voxels are at or above it. Where these are equal (maps of
    /// bytes, dropped samples) it encloses the nearest number that a level can, if that is within a tenth of
    /// n. Without a box only samples above the background count, which goes on for ever. Otsu: the samples
    /// are counted in 65536 bins between minimum and maximum; the level is the one that makes the variance
    /// between the classes below and above, w(1−w)(μ₁−μ₂)², the largest, half-way between the neighbouring
    /// bins that are not empty (Otsu, IEEE Trans. SMC 9:62–66, 1979).
    ///
    /// Throws InvalidInput for a level set (it has distances, its surface is at 0), for a volume that no
    /// level encloses, telling the range of those that one does, and by otsu where all samples are equal;
    /// Cancelled. The same for any number of threads. Cost: two passes over the samples.
    double resolve(const DensityMap& map, const Progress& progress = {}) const;
};

}  // namespace vdbgeo
