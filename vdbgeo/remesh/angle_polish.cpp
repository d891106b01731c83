#include "vdbgeo/remesh/angle_polish.h"
namespace vdbgeo {
void polish_angles(RemeshState&, double) {}
}  // namespace vdbgeo
