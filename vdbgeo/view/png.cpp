#include "vdbgeo/view/png.h"

#include <fmt/format.h>
#include <png.h>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void write_png(const Image& image, const std::filesystem::path& path) {
    const auto w = static_cast<std::size_t>(image.width), h = static_cast<std::size_t>(image.height);
    if (image.width < 1 || image.height < 1 || image.pixels.size() != 3 * w * h)
        throw InvalidInput(fmt::format("{}: a picture of {} x {} pixels with {} bytes cannot be written",
                                       path.string(), image.width, image.height, image.pixels.size()));
    png_image header{};
    header.version = PNG_IMAGE_VERSION;
    header.width = static_cast<png_uint_32>(image.width);
    header.height = static_cast<png_uint_32>(image.height);
    header.format = PNG_FORMAT_RGB;
    // Encoding into memory first keeps libpng's error handling (longjmp) away from the file's.
    Array<char> bytes(PNG_IMAGE_PNG_SIZE_MAX(header));
    png_alloc_size_t size = bytes.size();
    if (!png_image_write_to_memory(&header, bytes.data(), &size, 0, image.pixels.data(), 0, nullptr))
        throw IoError(fmt::format("{}: PNG encoding failed: {}", path.string(), header.message));
    write_file(path, {bytes.data(), size});
}

}  // namespace vdbgeo
