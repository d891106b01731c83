#include "converters/mapped_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

[[noreturn]] void fail(const std::string& name, const char* doing) {
    throw IoError(fmt::format("{}: {}: {}", name, doing, std::strerror(errno)));
}

/// Closes the descriptor on every way out; a mapping outlives it.
struct Descriptor {
    int number;
    ~Descriptor() {
        if (number >= 0) ::close(number);
    }
};

}  // namespace

MappedFile::MappedFile(const std::filesystem::path& path)
    : name_(path == "-" ? "standard input" : path.string()) {
    const Descriptor file{path == "-" ? ::dup(STDIN_FILENO) : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
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
}

MappedFile::~MappedFile() {
    if (mapping_) ::munmap(mapping_, size_);
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
