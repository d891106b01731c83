// Output files that appear whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string_view>

namespace vdbgeo {

/// Writes a file beside its target and puts it in the target's place on `commit`, after everything has
/// reached the disk. Until then, and when anything fails (full disk, kill -9, an exception), an old file of
/// that name stays byte for byte as it was. Without `commit` nothing remains.
///
/// Where the file system allows it the data has no name before `commit`, so not even a killed process leaves
/// a temporary behind. A target that exists and is not a regular file (/dev/stdout, a pipe) is written
/// directly; the target "-" is standard output.
///
/// Every failure throws IoError naming the target. Seeking in `stream()` is supported for regular files.
class AtomicFile {
 public:
    explicit AtomicFile(const std::filesystem::path& target);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    /// A stream that throws IoError at the first write that fails.
    std::ostream& stream();
    void write(std::string_view bytes);
    void write(const void* data, std::size_t bytes);

    /// Whether what was written can be gone back to: true for regular files, false where the target is
    /// written directly.
    bool seekable() const;
    /// Overwrites bytes at `position`; what is written next still goes where it would have gone. Seekable
    /// files.
    void write_at(std::uint64_t position, const void* data, std::size_t bytes);
    /// Takes back bytes that were written before the last `flush`; from any thread. Seekable files.
    void read_at(std::uint64_t position, void* out, std::size_t bytes) const;
    /// Hands over to the system what is still held back here. Returns how long the file is.
    std::uint64_t flush();

    /// Flushes to the disk and renames. Call it once, last.
    void commit();

 private:
    class Sink;
    std::unique_ptr<Sink> sink_;
    std::unique_ptr<std::ostream> stream_;
};

/// Writes `bytes` to `target` as AtomicFile does.
void write_file(const std::filesystem::path& target, std::string_view bytes);

}  // namespace vdbgeo
