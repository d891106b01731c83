// A whole input file as bytes in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "vdbgeo/core/types.h"

namespace vdbgeo {

/// The bytes of a file: a regular file is mapped, so that nothing is copied and no memory is taken that the
/// system could not have back; a pipe is read to its end; "-" is standard input. Throws IoError where the
/// file cannot be read or is a folder.
class MappedFile {
 public:
    explicit MappedFile(const std::filesystem::path& path);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    std::string_view bytes() const { return {data_, size_}; }
    /// Copies bytes out without touching the mapping: memory that is mapped and looked at counts as the
    /// program's until it is released. From any thread. Throws IoError where the file has become shorter.
    void read_at(std::uint64_t position, void* out, std::size_t bytes) const;
    /// Gives back the memory that looking at the bytes took; they can be looked at again.
    void release() const;
    /// What error messages call the file.
    const std::string& name() const { return name_; }

 private:
    void read_pipe(int descriptor);

    std::string name_;
    int descriptor_ = -1;  // of a regular file
    const char* data_ = nullptr;
    std::size_t size_ = 0;
    void* mapping_ = nullptr;
    Array<char> copy_;  // of a pipe
};

}  // namespace vdbgeo
