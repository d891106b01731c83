// The record of a map in the EMDB, as its API (JSON) or its header file (XML) gives it.
#pragma once

#include <filesystem>

namespace vdbgeo {

/// The contour level that the depositors recommend (the primary one). Throws IoError, or InvalidInput where the file
/// holds none.
double recommended_contour(const std::filesystem::path& record);

}  // namespace vdbgeo
