#include "converters/vdb_checksum.h"

#include <fmt/format.h>

#define XXH_INLINE_ALL  // nothing to link, and the compiler's own vectors
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

namespace {

constexpr std::uint64_t chunk_bytes = 1 << 20;
constexpr std::size_t identifier_bytes = 36, hash_bytes = 32;
constexpr const char* kind = "xxh3-128 ";
constexpr std::size_t kind_bytes = 9, hash_in_value = kind_bytes + identifier_bytes + 1;
// Signature, version, library version, offsets flag; then the identifier.
constexpr std::uint64_t identifier_at = 8 + 4 + 8 + 1;
// Number of entries; the entry's name, type, and value, each behind its length.
constexpr std::uint64_t written_value_at = identifier_at + identifier_bytes + 4 + 4 + 15 + 4 + 6 + 4;

std::string value_of(const std::string& identifier, const std::string& hash) {
    return kind + identifier + " " + hash;
}

std::string hex(const XXH128_hash_t& hash) { return fmt::format("{:016x}{:016x}", hash.high64, hash.low64); }

/// `read(position, out, bytes)` gives the file's bytes, from any thread; those of the hash count as zeros.
template <class Read>
XXH128_hash_t hash_chunk(std::uint64_t begin, std::uint64_t end, std::uint64_t hash_at, const Read& read) {
    XXH3_state_t state;
    XXH3_INITSTATE(&state);
    XXH3_128bits_reset(&state);
    std::array<char, 1 << 16> buffer;
    for (std::uint64_t at = begin; at < end;) {
        const std::size_t n = std::min<std::uint64_t>(buffer.size(), end - at);
        read(at, buffer.data(), n);
        const std::uint64_t from = std::max(at, hash_at), to = std::min(at + n, hash_at + hash_bytes);
        if (from < to) std::memset(buffer.data() + (from - at), '0', to - from);
        XXH3_128bits_update(&state, buffer.data(), n);
        at += n;
    }
    return XXH3_128bits_digest(&state);
}

template <class Read>
std::string hash_file(std::uint64_t size, std::uint64_t hash_at, const Read& read) {
    std::vector<XXH128_canonical_t> chunks((size + chunk_bytes - 1) / chunk_bytes);
    parallel_for(chunks.size(), 4, [&](std::size_t c) {
        const std::uint64_t begin = c * chunk_bytes;
        XXH128_canonicalFromHash(&chunks[c],
                                 hash_chunk(begin, std::min(size, begin + chunk_bytes), hash_at, read));
    });
    return hex(XXH3_128bits(chunks.data(), chunks.size() * sizeof chunks[0]));
}

}  // namespace

std::string blank_vdb_checksum() {
    return value_of(std::string(identifier_bytes, '0'), std::string(hash_bytes, '0'));
}

void seal_vdb(AtomicFile& file, const std::string& identifier) {
    const std::uint64_t size = file.flush();
    const std::string blank = blank_vdb_checksum();
    std::string there(blank.size(), '\0');
    file.read_at(written_value_at, there.data(), there.size());
    if (there != blank) throw IoError("the checksum has no place in the file's metadata");
    file.write_at(identifier_at, identifier.data(), identifier.size());
    const std::string value = value_of(identifier, std::string(hash_bytes, '0'));
    file.write_at(written_value_at, value.data(), value.size());
    const std::uint64_t hash_at = written_value_at + hash_in_value;
    const std::string hash = hash_file(
        size, hash_at, [&](std::uint64_t at, char* out, std::size_t n) { file.read_at(at, out, n); });
    file.write_at(hash_at, hash.data(), hash.size());
}

void verify_vdb(const MappedFile& file, const std::string& identifier, const std::string& value,
                std::uint64_t value_at) {
    if (value.size() != hash_in_value + hash_bytes || value.compare(0, kind_bytes, kind) != 0 ||
        value.compare(kind_bytes, identifier_bytes, identifier) != 0)
        return;
    const std::string found =
        hash_file(file.bytes().size(), value_at + hash_in_value,
                  [&](std::uint64_t at, char* out, std::size_t n) { file.read_at(at, out, n); });
    if (value.compare(hash_in_value, hash_bytes, found) != 0)
        throw InvalidInput(
            fmt::format("{}: its bytes are not those that were written (checksum {}, expected {})",
                        file.name(), found, value.substr(hash_in_value)));
}

}  // namespace vdbgeo
