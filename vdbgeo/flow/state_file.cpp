#include "vdbgeo/flow/state_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <tbb/parallel_sort.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <tuple>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/file_hash.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/block_field.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using stencil::BlockField;
using stencil::BlockLayout;

constexpr std::size_t brick_bytes = BlockField::brick_size * sizeof(float);
constexpr std::size_t buffered = std::size_t(8) << 20;

/// A file ends with the first voxels of its bricks and this.
struct Tail {
    char magic[16] = "vdbgeo state 1\n";
    std::uint64_t bricks = 0, fields = 0;
};

[[noreturn]] void fail(const std::filesystem::path& path, const char* doing) {
    throw IoError(fmt::format("{}: {}: {}", path.string(), doing, std::strerror(errno)));
}

}  // namespace

struct StateWriter::File {
    std::filesystem::path path;
    std::size_t fields;
    int fd = -1;
    std::vector<char> buffer;
    std::vector<Coord> origins;
    RunningHash hash;

    void put(const void* data, std::size_t bytes) {
        const char* from = static_cast<const char*>(data);
        buffer.insert(buffer.end(), from, from + bytes);
        if (buffer.size() >= buffered) flush();
    }
    void flush() {
        hash.add(buffer.data(), buffer.size());
        for (std::size_t at = 0; at < buffer.size();) {
            const ssize_t n = ::write(fd, buffer.data() + at, buffer.size() - at);
            if (n < 0 && errno == EINTR) continue;
            if (n < 0) fail(path, "cannot be written");
            at += static_cast<std::size_t>(n);
        }
        buffer.clear();
    }
};

StateWriter::StateWriter(const std::filesystem::path& path, std::size_t fields)
    : file_(std::make_unique<File>()) {
    file_->path = path;
    file_->fields = fields;
    file_->buffer.reserve(buffered + brick_bytes);
    file_->fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (file_->fd < 0) fail(path, "cannot be made");
}

StateWriter::~StateWriter() {
    if (file_->fd >= 0) ::close(file_->fd);
}

void StateWriter::add(const BlockLayout& layout, const std::vector<const float*>& fields) {
    for (std::size_t b = 0; b < layout.brick_count(); ++b) {
        if (!layout.works_on(b)) continue;
        file_->origins.push_back(layout.origin(b));
        for (const float* field : fields) file_->put(field + b * BlockField::brick_size, brick_bytes);
    }
}

std::string StateWriter::finish() {
    file_->put(file_->origins.data(), file_->origins.size() * sizeof(Coord));
    Tail tail;
    tail.bricks = file_->origins.size();
    tail.fields = file_->fields;
    file_->put(&tail, sizeof tail);
    file_->flush();
    if (::fsync(file_->fd) != 0) fail(file_->path, "cannot be written");
    const int fd = std::exchange(file_->fd, -1);
    if (::close(fd) != 0) fail(file_->path, "cannot be written");
    return file_->hash.digest();
}

struct StateReader::Files {
    struct Place {
        Coord origin;
        std::uint32_t file, brick;
    };
    std::vector<std::filesystem::path> paths;
    std::vector<int> fds;
    std::vector<Place> places;  // sorted by origin
    std::size_t fields = 0;

    ~Files() {
        for (const int fd : fds)
            if (fd >= 0) ::close(fd);
    }
    void read(std::size_t file, std::uint64_t at, void* out, std::size_t bytes) const {
        char* to = static_cast<char*>(out);
        while (bytes > 0) {
            const ssize_t n = ::pread(fds[file], to, bytes, static_cast<off_t>(at));
            if (n < 0 && errno == EINTR) continue;
            if (n == 0) throw InvalidInput(paths[file].string() + ": the file is cut short");
            if (n < 0) fail(paths[file], "cannot be read");
            to += n;
            at += static_cast<std::uint64_t>(n);
            bytes -= static_cast<std::size_t>(n);
        }
    }
    void open(const std::filesystem::path& path);
};

void StateReader::Files::open(const std::filesystem::path& path) {
    const std::size_t i = paths.size();
    paths.push_back(path);
    fds.push_back(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (fds.back() < 0) fail(path, "cannot be opened");
    struct stat about {};
    if (::fstat(fds.back(), &about) != 0) fail(path, "cannot be read");
    const auto size = static_cast<std::uint64_t>(about.st_size);
    Tail tail, expected;
    if (size >= sizeof tail) read(i, size - sizeof tail, &tail, sizeof tail);
    const std::uint64_t record = fields * brick_bytes;
    if (size < sizeof tail || std::memcmp(tail.magic, expected.magic, sizeof tail.magic) != 0 ||
        tail.fields != fields || size - sizeof tail != tail.bricks * (record + sizeof(Coord)))
        throw InvalidInput(path.string() + ": it is not the state of such a computation");
    std::vector<Coord> origins(tail.bricks);
    read(i, tail.bricks * record, origins.data(), origins.size() * sizeof(Coord));
    for (std::size_t b = 0; b < origins.size(); ++b)
        places.push_back({origins[b], static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(b)});
}

StateReader::StateReader(const std::vector<std::filesystem::path>& files, std::size_t fields)
    : files_(std::make_unique<Files>()) {
    files_->fields = fields;
    for (const auto& path : files) files_->open(path);
    tbb::parallel_sort(files_->places.begin(), files_->places.end(),
                       [](const Files::Place& a, const Files::Place& b) { return a.origin < b.origin; });
}

StateReader::~StateReader() = default;

void StateReader::read(const BlockLayout& layout, const std::vector<float*>& fields) const {
    const Files& f = *files_;
    parallel_blocks(layout.brick_count(), 64, [&](std::size_t begin, std::size_t end) {
        std::vector<float> values(f.fields * BlockField::brick_size);
        for (std::size_t b = begin; b < end; ++b) {
            const auto place =
                std::lower_bound(f.places.begin(), f.places.end(), layout.origin(b),
                                 [](const Files::Place& p, const Coord& at) { return p.origin < at; });
            if (place == f.places.end() || place->origin != layout.origin(b))
                throw InvalidInput(f.paths.empty() ? std::string("there is no state")
                                                   : f.paths[0].string() + ": leaves of the map are missing");
            f.read(place->file, place->brick * f.fields * brick_bytes, values.data(),
                   values.size() * sizeof(float));
            for (std::size_t i = 0; i < fields.size(); ++i)
                std::copy_n(values.data() + i * BlockField::brick_size, BlockField::brick_size,
                            fields[i] + b * BlockField::brick_size);
        }
    });
}

}  // namespace vdbgeo
