// A file as a stream of bytes, unpacked on the way where it is compressed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

namespace vdbgeo {

/// Reads a file from front to end: plain, gzip, bzip2 or zstd, told apart by content and not by name. Only as
/// much is unpacked as is asked for. The name "-" is standard input. A file that cannot be opened or read is
/// an IoError; compressed data that is damaged is InvalidInput.
class ByteSource {
 public:
    static std::unique_ptr<ByteSource> open(const std::filesystem::path& path);
    virtual ~ByteSource() = default;
    ByteSource(const ByteSource&) = delete;
    ByteSource& operator=(const ByteSource&) = delete;

    /// Fills `out` with the next `bytes` bytes; returns how many there were, fewer only at the end.
    std::size_t read(void* out, std::size_t bytes);
    /// Passes over the next `bytes` bytes; returns how many there were.
    std::uint64_t skip(std::uint64_t bytes);

    /// Bytes read or skipped so far.
    std::uint64_t position() const { return position_; }
    /// Length of the whole stream, where it is known without reading it: plain files.
    virtual std::optional<std::uint64_t> length() const { return std::nullopt; }
    /// No stream of this kind is longer than this, given the bytes that the file has.
    virtual std::uint64_t length_bound() const = 0;
    /// Descriptor of a plain regular file, whose bytes can be read at any position; else -1.
    virtual int descriptor() const { return -1; }
    /// "gzip", "bzip2" or "zstd"; empty for a plain file.
    const std::string& compression() const { return compression_; }
    /// The end was met in the middle of the compressed data.
    bool cut_off() const { return cut_off_; }
    /// What to call the file in messages.
    const std::string& name() const { return name_; }

 protected:
    ByteSource(std::string name, std::string compression)
        : name_(std::move(name)), compression_(std::move(compression)) {}

    virtual std::size_t read_some(void* out, std::size_t bytes) = 0;  // 0 only at the end
    virtual std::uint64_t seek_past(std::uint64_t) { return 0; }      // what can be skipped without reading

    bool cut_off_ = false;

 private:
    std::string name_, compression_;
    std::uint64_t position_ = 0;
};

}  // namespace vdbgeo
