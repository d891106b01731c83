// Bytes that may not fit into memory: a store that begins to use a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "vdbgeo/core/scratch_file.h"

namespace vdbgeo {

/// Bytes that come one after another and are read back later: the first `memory` of them are held in memory,
/// the rest in a ScratchFile.
class ByteStore {
 public:
    ByteStore(std::uint64_t memory, std::filesystem::path folder)
        : memory_(memory), folder_(std::move(folder)) {}

    /// Adds bytes; they begin at the size() of before.
    void append(const void* data, std::size_t bytes);
    /// May be called from many threads, once nothing is added any more.
    void read(std::uint64_t at, void* out, std::size_t bytes) const;
    std::uint64_t size() const { return size_; }
    /// Bytes that went to the disk.
    std::uint64_t spilled() const { return size_ - held(); }

 private:
    static constexpr std::uint64_t chunk = 1 << 20;
    std::uint64_t held() const { return file_ ? chunks_.size() * chunk : size_; }

    std::uint64_t memory_, size_ = 0;
    std::filesystem::path folder_;
    std::vector<std::unique_ptr<char[]>> chunks_;
    std::optional<ScratchFile> file_;
};

}  // namespace vdbgeo
