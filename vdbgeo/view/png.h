// PNG files.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "vdbgeo/view/image.h"

namespace vdbgeo {

/// Writes the picture as an 8-bit RGB PNG marked sRGB. The same pixels give the same bytes.
/// Errors: InvalidInput for an image without pixels, IoError where the file cannot be written whole.
void write_png(const Image& image, const std::filesystem::path& path);

/// The bytes of such a file.
std::string png_bytes(const Image& image);

/// The picture of a PNG file given by its bytes, in 8-bit RGB, on white where it is transparent. InvalidInput
/// where they are no whole PNG, or a picture larger than Image may be.
Image read_png(std::string_view bytes);

}  // namespace vdbgeo
