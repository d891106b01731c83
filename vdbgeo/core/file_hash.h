// Hashes of bytes, to tell whether they are still the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// XXH3-128 of all bytes of a file, or of a text, as 32 hexadecimal digits. It tells changes, it does not
/// withstand forgery. IoError where the file cannot be read. Cost: one reading of the file.
std::string file_hash(const std::filesystem::path& path, const Progress& progress = {});
std::string text_hash(const std::string& text);

/// The same of bytes that come one after another.
class RunningHash {
 public:
    RunningHash();
    ~RunningHash();
    void add(const void* data, std::size_t bytes);
    std::string digest() const;

 private:
    struct State;
    std::unique_ptr<State> state_;
};

/// XXH3-64 of some bytes and a number.
std::uint64_t hash_of(const void* data, std::size_t bytes, std::uint64_t seed);

}  // namespace vdbgeo
