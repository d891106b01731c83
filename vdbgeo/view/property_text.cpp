#include "vdbgeo/view/property_text.h"

#include <map>

namespace vdbgeo {

PropertyText property_text(const std::string& name) {
    static const std::map<std::string, PropertyText> known{
        {"H", {"mean curvature H (1/\u00c5)"}},
        {"K", {"Gaussian curvature K (1/\u00c5\u00b2)"}},
        {"k1", {"largest curvature k1 (1/\u00c5)"}},
        {"k2", {"smallest curvature k2 (1/\u00c5)"}},
        {"shape_index", {"shape index (\u22121 peak, 0 saddle, 1 pit)"}},
        {"curvedness", {"curvedness (1/\u00c5)"}},
        {"type", {"type of surface", true}},
        {"pocket", {"pockets by rank (0: none)", true}},
        {"protrusion", {"protrusions by rank (0: none)", true}},
        {"label", {"label", true}},
        {"region", {"region", true}},
        {"component", {"piece", true}},
        {"min_dihedral_deg", {"smallest dihedral angle (\u00b0)"}},
        {"max_dihedral_deg", {"largest dihedral angle (\u00b0)"}},
        {"radius_edge", {"radius-edge ratio"}},
        {"volume_A3", {"volume (\u00c5\u00b3)"}},
    };
    const auto found = known.find(name);
    return found == known.end() ? PropertyText{name} : found->second;
}

}  // namespace vdbgeo
