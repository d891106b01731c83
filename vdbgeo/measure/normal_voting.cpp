#include "vdbgeo/measure/normal_voting.h"

namespace vdbgeo {}
namespace vdbgeo { Curvatures voted_curvature(const TriMesh&, const NormalVotingOptions&, const Progress&){return {};} }
