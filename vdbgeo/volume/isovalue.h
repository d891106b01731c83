// Which level of a map is its surface.
#pragma once

#include <string>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// A level as a user gives it: a number in the map's units, or a rule that takes it from the map's
/// statistics.
struct Isovalue {
    enum class Rule {
        automatic,  ///< by the class of the grid: 0 for a level set, half the maximum for a fog volume, else
                    ///< mean
                    ///< + 3 rms over all samples of the map
        value,      ///< `number`
        sigma       ///< mean + `number` · rms over all samples of the map
    };

    Rule rule = Rule::automatic;
    double number = 0;

    /// "auto", "0.7", "3sigma". Throws InvalidInput for anything else.
    static Isovalue parse(const std::string& text);
    /// The inverse of parse.
    std::string text() const;
    /// The level for a map with these statistics in a grid of this class. Throws InvalidInput where the map
    /// has no finite sample to take statistics of.
    double resolve(const Statistics& statistics, openvdb::GridClass grid_class = openvdb::GRID_UNKNOWN) const;
};

}  // namespace vdbgeo
