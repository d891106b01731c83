// What the properties that vdbgeo gives its meshes are called in pictures.
#pragma once

#include <string>

namespace vdbgeo {

struct PropertyText {
    std::string label;     ///< in words, with its unit: "mean curvature H (1/Å)"
    bool classes = false;  ///< its values are numbers of classes, not quantities
};

/// The words for a property by its name; for one that is not known its name.
PropertyText property_text(const std::string& name);

}  // namespace vdbgeo
