#include "converters/mesh_pieces.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

constexpr std::uint64_t point_bytes = 12, triangle_bytes = 13;
constexpr std::uint64_t together = 1 << 16;  // triangles that are put into their form at a time

}  // namespace

std::string ply_header(std::uint64_t vertices, std::uint64_t triangles, const std::string& of_vertices,
                       const std::string& of_faces) {
    // Many readers know int only.
    const char* const index = vertices > 0x80000000ull ? "uint" : "int";
    return fmt::format(
        "ply\nformat binary_little_endian 1.0\ncomment vdbgeo, coordinates in Angstrom\n"
        "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}"
        "element face {}\nproperty list uchar {} vertex_indices\n{}end_header\n",
        vertices, of_vertices, triangles, index, of_faces);
}

PlyPieces::PlyPieces(AtomicFile& file, std::uint64_t vertices, std::uint64_t triangles)
    : file_(&file),
      header_(ply_header(vertices, triangles)),
      first_triangle_at_(header_.size() + vertices * point_bytes) {}

PlyPieces::PlyPieces(const std::filesystem::path& path, bool make, std::uint64_t vertices,
                     std::uint64_t triangles)
    : path_(path),
      header_(ply_header(vertices, triangles)),
      first_triangle_at_(header_.size() + vertices * point_bytes) {
    static_assert(sizeof(Vec3f) == point_bytes && sizeof(Triangle) == 12);
    fd_ = ::open(path.c_str(), O_RDWR | (make ? O_CREAT | O_TRUNC : 0) | O_CLOEXEC, 0666);
    if (fd_ < 0) fail("cannot be opened");
}

PlyPieces::~PlyPieces() {
    if (fd_ >= 0) ::close(fd_);
}

void PlyPieces::fail(const char* doing) const {
    throw IoError(fmt::format("{}: {}: {}", path_.string(), doing, std::strerror(errno)));
}

void PlyPieces::write_at(std::uint64_t at, const void* data, std::size_t bytes) {
    if (file_) return file_->write_at(at, data, bytes);
    for (const char* from = static_cast<const char*>(data); bytes > 0;) {
        const ssize_t written = ::pwrite(fd_, from, bytes, static_cast<off_t>(at));
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) fail("writing failed");
        from += written;
        at += static_cast<std::uint64_t>(written);
        bytes -= static_cast<std::size_t>(written);
    }
}

void PlyPieces::put_header() { write_at(0, header_.data(), header_.size()); }

void PlyPieces::put_points(std::uint64_t first, const Vec3f* points, std::uint64_t count) {
    write_at(header_.size() + first * point_bytes, points, count * point_bytes);
}

void PlyPieces::put_triangles(std::uint64_t first, const Triangle* triangles, std::uint64_t count) {
    std::vector<char> bytes(std::min(count, together) * triangle_bytes);
    for (std::uint64_t done = 0; done < count; done += together) {
        const std::uint64_t n = std::min(together, count - done);
        char* to = bytes.data();
        for (std::uint64_t i = 0; i < n; ++i, to += triangle_bytes) {
            *to = 3;
            std::memcpy(to + 1, &triangles[done + i], sizeof(Triangle));
        }
        write_at(first_triangle_at_ + (first + done) * triangle_bytes, bytes.data(), n * triangle_bytes);
    }
}

void PlyPieces::close() {
    const int fd = fd_;
    if (::fsync(fd) != 0) fail("writing failed");
    fd_ = -1;
    if (::close(fd) != 0) fail("writing failed");
}

}  // namespace vdbgeo
