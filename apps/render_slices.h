// Sections of maps as pictures: `render --slices` and `denoise --slices`.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "apps/flags.h"
#include "apps/session.h"
#include "vdbgeo/view/sections.h"

namespace vdbgeo::app {

/// Which section of a map: "z" its middle, "z=40" a voxel from 0, "z=120A" the one nearest to this place.
struct SliceWish {
    int axis = 2;
    std::optional<int> voxel;
    std::optional<double> place_A;

    /// UsageError for anything else.
    static SliceWish parse(const std::string& text);
    Section take(const DensityMap& map) const;
};

/// Maps to be shown in rows, with the names above them.
struct SlicesInput {
    std::vector<std::string> files, names;
    std::vector<SliceWish> wishes;    ///< empty: the middle across z, y and x
    std::optional<Isovalue> contour;  ///< where the surface at this isovalue goes
    MapReadOptions reading;
};

/// The figure of all maps; of the options of a render it takes what sections have too.
Image slices_picture(const SlicesInput& input, const RenderOptions& options, Session& session);

/// The middle sections of a map before and after something is done to it, as bare pictures with the same
/// greys and sizes: PREFIX_before_x.png, PREFIX_after_x.png, and y, z.
class SlicePairs {
 public:
    void take_before(const DensityMap& map);
    void take_after(const DensityMap& map);
    /// Writes them and returns their names.
    std::vector<std::string> write(const std::string& prefix) const;

 private:
    std::array<Section, 3> before_, after_;
};

}  // namespace vdbgeo::app
