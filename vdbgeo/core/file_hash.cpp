#include "vdbgeo/core/file_hash.h"

#define XXH_INLINE_ALL  // nothing to link
#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

struct RunningHash::State {
    XXH3_state_t xxh;
};

RunningHash::RunningHash() : state_(std::make_unique<State>()) {
    XXH3_INITSTATE(&state_->xxh);
    XXH3_128bits_reset(&state_->xxh);
}
RunningHash::~RunningHash() = default;

void RunningHash::add(const void* data, std::size_t bytes) {
    if (bytes > 0) XXH3_128bits_update(&state_->xxh, data, bytes);
}

std::string RunningHash::digest() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(&state_->xxh);
    return fmt::format("{:016x}{:016x}", static_cast<std::uint64_t>(hash.high64),
                       static_cast<std::uint64_t>(hash.low64));
}

std::string file_hash(const std::filesystem::path& path, const Progress& progress) {
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    std::ifstream in(path, std::ios::binary);
    if (error || !in) throw IoError(fmt::format("{}: cannot be opened", path.string()));
    RunningHash hash;
    std::vector<char> buffer(std::size_t(1) << 20);
    double done = 0;
    while (in) {
        in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
        const auto n = static_cast<std::size_t>(in.gcount());
        hash.add(buffer.data(), n);
        done += static_cast<double>(n);
        if (size > 0) progress.report(std::min(1.0, done / static_cast<double>(size)));
    }
    if (in.bad()) throw IoError(fmt::format("{}: reading failed: {}", path.string(), std::strerror(errno)));
    return hash.digest();
}

std::string text_hash(const std::string& text) {
    RunningHash hash;
    hash.add(text.data(), text.size());
    return hash.digest();
}

std::uint64_t hash_of(const void* data, std::size_t bytes, std::uint64_t seed) {
    return XXH3_64bits_withSeed(data, bytes, seed);
}

}  // namespace vdbgeo
