// PNG files.
#pragma once

#include <filesystem>

#include "vdbgeo/view/image.h"

namespace vdbgeo {

/// Writes the picture as an 8-bit RGB PNG marked sRGB. The same pixels give the same bytes.
/// Errors: InvalidInput for an image without pixels, IoError where the file cannot be written whole.
void write_png(const Image& image, const std::filesystem::path& path);

}  // namespace vdbgeo
