// A checksum in VDB files of this project: damage that the format itself cannot tell is told.
#pragma once

#include <cstdint>
#include <string>

#include "converters/mapped_file.h"
#include "vdbgeo/core/atomic_file.h"

namespace vdbgeo {

/// Name of the entry in the file's metadata (not a grid's), of type string: "xxh3-128 IDENTIFIER HASH". HASH
/// is XXH3-128 over the XXH3-128 of every MiB of the file, big-endian, with HASH itself taken as 32 zeros.
/// IDENTIFIER is that of the file's header when it was written: another program that rewrites the file, and
/// copies its metadata, gives it another one, and the entry no longer counts.
constexpr const char* vdb_checksum_key = "vdbgeo_checksum";

/// The entry's value before anything is known: of the right length.
std::string blank_vdb_checksum();

/// Puts identifier and checksum into a file that was written with the blank entry as its only metadata. Reads
/// the file back, on all threads.
void seal_vdb(AtomicFile& file, const std::string& identifier);

/// Compares a file with its entry, whose value begins at byte `value_at`. An entry that is another file's, or
/// of a kind not known, is passed over. Throws InvalidInput where the bytes are not those that were written.
/// Cost: one reading of the file, on all threads.
void verify_vdb(const MappedFile& file, const std::string& identifier, const std::string& value,
                std::uint64_t value_at);

}  // namespace vdbgeo
