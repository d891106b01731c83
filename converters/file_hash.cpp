#include "converters/file_hash.h"

#define XXH_INLINE_ALL  // nothing to link
#include <fmt/format.h>
#include <xxhash.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

std::string hex(const XXH128_hash_t& hash) {
    return fmt::format("{:016x}{:016x}", static_cast<std::uint64_t>(hash.high64),
                       static_cast<std::uint64_t>(hash.low64));
}

}  // namespace

std::string file_hash(const std::filesystem::path& path, const Progress& progress) {
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    std::ifstream in(path, std::ios::binary);
    if (error || !in) throw IoError(fmt::format("{}: cannot be opened", path.string()));
    XXH3_state_t state;
    XXH3_INITSTATE(&state);
    XXH3_128bits_reset(&state);
    std::vector<char> buffer(std::size_t(1) << 20);
    double done = 0;
    while (in) {
        in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
        const auto n = static_cast<std::size_t>(in.gcount());
        XXH3_128bits_update(&state, buffer.data(), n);
        done += static_cast<double>(n);
        if (size > 0) progress.report(std::min(1.0, done / static_cast<double>(size)));
    }
    if (in.bad()) throw IoError(fmt::format("{}: reading failed: {}", path.string(), std::strerror(errno)));
    return hex(XXH3_128bits_digest(&state));
}

std::string text_hash(const std::string& text) { return hex(XXH3_128bits(text.data(), text.size())); }

}  // namespace vdbgeo
