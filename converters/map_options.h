// How a map is read: which part of it, on which scale, and which of its samples are kept.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "converters/mrc.h"
#include "vdbgeo/volume/sparsify.h"

namespace vdbgeo {

/// A box of samples along x, y, z, counted from 0 in the order of the axes of the world: from `begin` up to,
/// but without, `end`. What is unset reaches to the border of the map.
struct Crop {
    std::array<std::optional<int>, 3> begin, end;
};

/// A threshold as a user gives it.
struct ThresholdRule {
    enum class Kind {
        value,       ///< `number`, in the map's units
        sigma,       ///< mean + `number` · rms over all samples
        percentile,  ///< the value that `number` per cent of the finite samples do not exceed
        fraction     ///< keeps this part (0…1) of the finite samples, the densest
    };
    Kind kind = Kind::value;
    double number = 0;

    /// "0.7", "3sigma", "95%". Throws InvalidInput for anything else.
    static ThresholdRule parse(const std::string& text);
    void check() const;
};

struct MapReadOptions {
    enum class Normalise {
        none,
        sigma,  ///< mean 0, rms 1
        range   ///< minimum 0, maximum 1
    };

    MrcReadOptions mrc;  ///< how to read an MRC or CCP4 file

    // In the order in which they are applied to an MRC file; a VDB grid is taken as it is.
    std::optional<Crop> crop;
    /// Means over bin³ samples take their place; samples beyond the last whole block are left out. The first
    /// new voxel centre is that of its block: (bin − 1)/2 old steps further in along each axis.
    int bin = 1;
    /// Negate the samples: in raw tomograms what is dense is dark.
    bool invert = false;
    /// By the statistics of the samples as they are now. What follows is in the new units.
    Normalise normalise = Normalise::none;
    /// Which samples to keep. Its threshold is a value; the others are below.
    SparsifyOptions sparsify;
    /// A threshold that takes a pass of its own, in place of sparsify.threshold.
    std::optional<ThresholdRule> threshold;
    /// A map file of the same size (before crop and bin, or after), or a grid in a VDB file (after): only
    /// samples where it is above 0 are kept.
    std::filesystem::path mask;
    /// Drop face-connected pieces of fewer kept voxels than this. 0: none.
    std::uint64_t despeckle = 0;
    /// Keep all samples within this many voxels (along each axis) of what is kept. 0: none.
    int halo = 0;

    /// Round what is kept to multiples of the largest power of two that is not above this: a value or sigmas.
    std::optional<ThresholdRule> quantise;

    std::optional<std::string>
        grid;  ///< name of the grid in a VDB file; unset: "density", else the first of floats
    /// Bytes of memory that the whole process may take; unset: half of the machine's.
    std::optional<std::uint64_t> memory;
    /// Where temporary files go, which have no name; empty: the system's folder for them.
    std::filesystem::path scratch;

    void check() const;
    /// Whether anything asks for a pass over the samples before the one that sorts them.
    bool needs_selection() const { return !mask.empty() || despeckle > 0 || halo > 0; }
    std::uint64_t memory_limit() const;
};

}  // namespace vdbgeo
