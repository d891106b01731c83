// A whole input file as bytes in memory.
#pragma once

#include <cstddef>
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
    /// What error messages call the file.
    const std::string& name() const { return name_; }

 private:
    void read_pipe(int descriptor);

    std::string name_;
    const char* data_ = nullptr;
    std::size_t size_ = 0;
    void* mapping_ = nullptr;
    Array<char> copy_;  // of a pipe
};

}  // namespace vdbgeo
