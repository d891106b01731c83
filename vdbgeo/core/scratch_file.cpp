#include "vdbgeo/core/scratch_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

ScratchFile::ScratchFile(const std::filesystem::path& folder) : folder_(folder.empty() ? "." : folder) {
#ifdef O_TMPFILE
    fd_ = ::open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
#endif
    if (fd_ >= 0) return;
    std::string pattern = (folder_ / ".vdbgeo.XXXXXX").string();
    fd_ = ::mkostemp(pattern.data(), O_CLOEXEC);
    if (fd_ < 0) fail("no temporary file can be made here");
    ::unlink(pattern.c_str());
}

ScratchFile::~ScratchFile() {
    if (fd_ >= 0) ::close(fd_);
}

void ScratchFile::fail(const char* doing) const {
    throw IoError(fmt::format("{}: {}: {}", folder_.string(), doing, std::strerror(errno)));
}

void ScratchFile::append(const void* data, std::size_t bytes) {
    const char* next = static_cast<const char*>(data);
    while (bytes > 0) {
        const ssize_t n = ::write(fd_, next, bytes);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail("writing a temporary file failed");
        next += n;
        bytes -= static_cast<std::size_t>(n);
    }
}

void ScratchFile::write(std::uint64_t at, const void* data, std::size_t bytes) {
    const char* next = static_cast<const char*>(data);
    while (bytes > 0) {
        const ssize_t n = ::pwrite(fd_, next, bytes, static_cast<off_t>(at));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail("writing a temporary file failed");
        next += n;
        at += static_cast<std::uint64_t>(n);
        bytes -= static_cast<std::size_t>(n);
    }
}

void ScratchFile::read(std::uint64_t at, void* out, std::size_t bytes) const {
    char* next = static_cast<char*>(out);
    while (bytes > 0) {
        const ssize_t n = ::pread(fd_, next, bytes, static_cast<off_t>(at));
        if (n < 0 && errno == EINTR) continue;
        if (n == 0) errno = EIO;
        if (n <= 0) fail("reading a temporary file failed");
        next += n;
        at += static_cast<std::uint64_t>(n);
        bytes -= static_cast<std::size_t>(n);
    }
}

}  // namespace vdbgeo
