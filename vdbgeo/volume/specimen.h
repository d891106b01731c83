// Simulated specimens, shaped after six well-known cryo-EM maps.
#pragma once

#include <string>
#include <vector>

#include "vdbgeo/volume/part_field.h"

namespace vdbgeo {

/// A phantom's name and one line on what it is.
struct PhantomKind {
    std::string name;
    std::string description;
};

/// What specimen_parts builds.
const std::vector<PhantomKind>& specimen_kinds();

/// The parts of a specimen, in Å, symmetry axis along z, box centred on the origin. They are sketches: sizes,
/// symmetry and order of the subunits follow the literature named at each builder, the fold of the chains
/// does not. Parts carry the name of what they stand for ("capsid", "tail", ...); each name keeps the
/// symmetry stated in the description, while the whole may have less (a five-fold head on a six-fold tail).
/// Throws InvalidInput for an unknown kind.
std::vector<Part> specimen_parts(const std::string& kind);

/// Length of the edge of the smallest cube around the origin, edges along the axes, that holds the surfaces
/// of the parts, in Å.
double parts_extent(const std::vector<Part>& parts);

}  // namespace vdbgeo
