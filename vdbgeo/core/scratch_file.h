// A file without a name, for bytes that do not fit into memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace vdbgeo {

/// A file without a name in `folder`, gone when it is closed, however the process ends. Bytes are added at
/// its end and read anywhere. Throws IoError naming the folder, where the disk is full too.
class ScratchFile {
 public:
    explicit ScratchFile(const std::filesystem::path& folder);
    ~ScratchFile();
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;

    void append(const void* data, std::size_t bytes);
    /// Puts bytes where they belong; those before may come later. May be called from many threads, and not
    /// together with append.
    void write(std::uint64_t at, const void* data, std::size_t bytes);
    /// May be called from many threads.
    void read(std::uint64_t at, void* out, std::size_t bytes) const;
    int descriptor() const { return fd_; }

 private:
    [[noreturn]] void fail(const char* doing) const;

    std::filesystem::path folder_;
    int fd_ = -1;
};

}  // namespace vdbgeo
