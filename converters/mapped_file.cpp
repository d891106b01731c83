#include "converters/mapped_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

[[noreturn]] void fail(const std::string& name, const char* doing) {
    throw IoError(fmt::format("{}: {}: {}", name, doing, std::strerror(errno)));
}

/// Closes the descriptor on every way out but the one that takes it.
struct Descriptor {
    int number;
    ~Descriptor() {
        if (number >= 0) ::close(number);
    }
};

}  // namespace

MappedFile::MappedFile(const std::filesystem::path& path)
    : name_(path == "-" ? "standard input" : path.string()) {
    Descriptor file{path == "-" ? ::dup(STDIN_FILENO) : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
    if (file.number < 0) fail(name_, "cannot be opened");
    struct stat status {};
    if (::fstat(file.number, &status) != 0) fail(name_, "cannot be opened");
    if (S_ISDIR(status.st_mode)) throw IoError(fmt::format("{}: is a directory", name_));
    if (!S_ISREG(status.st_mode)) {
        read_pipe(file.number);
        return;
    }
    size_ = static_cast<std::size_t>(status.st_size);
    if (size_ == 0) return;  // an empty mapping is an error
    void* mapping = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file.number, 0);
    if (mapping == MAP_FAILED) fail(name_, "cannot be read");
    mapping_ = mapping;
    data_ = static_cast<const char*>(mapping);
    ::madvise(mapping, size_, MADV_SEQUENTIAL);
    descriptor_ = std::exchange(file.number, -1);
}

MappedFile::~MappedFile() {
    if (mapping_) ::munmap(mapping_, size_);
    if (descriptor_ >= 0) ::close(descriptor_);
}

void MappedFile::read_at(std::uint64_t position, void* out, std::size_t bytes) const {
    if (position > size_ || bytes > size_ - position)
        throw IoError(
            fmt::format("{}: bytes {} to {} lie beyond its end", name_, position, position + bytes));
    if (descriptor_ < 0) {
        std::memcpy(out, data_ + position, bytes);
        return;
    }
    char* to = static_cast<char*>(out);
    while (bytes > 0) {
        const ssize_t n = ::pread(descriptor_, to, bytes, static_cast<off_t>(position));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail(name_, "reading failed");
        if (n == 0) throw IoError(fmt::format("{}: became shorter while it was read", name_));
        to += n;
        bytes -= static_cast<std::size_t>(n);
        position += static_cast<std::uint64_t>(n);
    }
}

void MappedFile::release() const {
    if (mapping_) ::madvise(mapping_, size_, MADV_DONTNEED);
}

void MappedFile::read_pipe(int descriptor) {
    constexpr std::size_t step = 1 << 20;
    for (std::size_t filled = 0;;) {
        copy_.resize(filled + step);
        const ssize_t n = ::read(descriptor, copy_.data() + filled, step);
        if (n < 0 && errno != EINTR) fail(name_, "reading failed");
        if (n > 0) filled += static_cast<std::size_t>(n);
        if (n == 0) {
            data_ = copy_.data();
            size_ = filled;
            return;
        }
    }
}

}  // namespace vdbgeo
