#include "vdbgeo/view/png.h"

#include <fmt/format.h>
#include <png.h>

#include "vdbgeo/core/atomic_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

std::string png_bytes(const Image& image) {
    const auto w = static_cast<std::size_t>(image.width), h = static_cast<std::size_t>(image.height);
    if (image.width < 1 || image.height < 1 || image.pixels.size() != 3 * w * h)
        throw InvalidInput(fmt::format("a picture of {} x {} pixels with {} bytes cannot be written",
                                       image.width, image.height, image.pixels.size()));
    png_image header{};
    header.version = PNG_IMAGE_VERSION;
    header.width = static_cast<png_uint_32>(image.width);
    header.height = static_cast<png_uint_32>(image.height);
    header.format = PNG_FORMAT_RGB;
    std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(header), '\0');
    png_alloc_size_t size = bytes.size();
    if (!png_image_write_to_memory(&header, bytes.data(), &size, 0, image.pixels.data(), 0, nullptr))
        throw IoError(fmt::format("PNG encoding failed: {}", header.message));
    bytes.resize(size);
    return bytes;
}

void write_png(const Image& image, const std::filesystem::path& path) {
    // Encoding into memory first keeps libpng's error handling (longjmp) away from the file's.
    std::string bytes;
    try {
        bytes = png_bytes(image);
    } catch (const InvalidInput& e) {
        throw InvalidInput(path.string() + ": " + e.what());
    }
    write_file(path, bytes);
}

Image read_png(std::string_view bytes) {
    png_image header{};
    header.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_memory(&header, bytes.data(), bytes.size()))
        throw InvalidInput(fmt::format("no PNG picture: {}", header.message));
    if (header.width > Image::max_side || header.height > Image::max_side) {
        png_image_free(&header);
        throw InvalidInput(
            fmt::format("a picture of {} x {} pixels is too large", header.width, header.height));
    }
    header.format = PNG_FORMAT_RGB;
    Image image(static_cast<int>(header.width), static_cast<int>(header.height));
    const png_color white{255, 255, 255};
    if (!png_image_finish_read(&header, &white, image.pixels.data(), 0, nullptr))
        throw InvalidInput(fmt::format("a damaged PNG picture: {}", header.message));
    return image;
}

}  // namespace vdbgeo
