// A hash of a file's bytes, to tell whether it is still the same.
#pragma once

#include <filesystem>
#include <string>

#include "vdbgeo/core/progress.h"

namespace vdbgeo {

/// XXH3-128 of all bytes of a file, or of a text, as 32 hexadecimal digits. It tells changes, it does not
/// withstand forgery. IoError where the file cannot be read. Cost: one reading of the file.
std::string file_hash(const std::filesystem::path& path, const Progress& progress = {});
std::string text_hash(const std::string& text);

}  // namespace vdbgeo
