// The maps that benchmarks run on: phantoms, or files.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo::bench {

/// A map that is made or read section by section, so that a contender's peak memory is its own.
struct Source {
    std::string name;
    Frame frame;
    std::optional<double> isovalue;
    std::function<void(int z0, int z1, float* out)> sections;  ///< x fastest; asked for once, in order

    std::size_t section_size() const {
        return static_cast<std::size_t>(frame.size.x()) * static_cast<std::size_t>(frame.size.y());
    }
};

Source phantom_source(const std::string& kind, int size, std::optional<double> snr);

/// A map file whose columns run along x and sections along z.
Source mrc_source(const std::string& path);

/// A source in the forms that contenders ask for; what nobody asks for is not made.
struct Inputs {
    std::vector<float> dense;
    std::optional<DensityMap> all;     ///< every sample kept
    std::optional<DensityMap> active;  ///< samples above the threshold kept
};
Inputs make_inputs(const Source& source, bool dense, bool all, std::optional<float> threshold);

/// Leaves of a map, and those of them with samples on both sides of the isovalue.
std::pair<std::uint64_t, std::uint64_t> count_leaves(const DensityMap& map, float isovalue);

}  // namespace vdbgeo::bench
