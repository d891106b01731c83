// The 1024 bytes of an MRC header ↔ numbers.
#pragma once

#include <array>
#include <cstddef>

#include "converters/mrc.h"

namespace vdbgeo {

constexpr std::size_t mrc_header_bytes = 1024;
using MrcHeaderBytes = std::array<unsigned char, mrc_header_bytes>;

constexpr std::int32_t imod_stamp_value = 1146047817;

/// Decodes a header. The byte order is the one in which sizes, mode and axes are plausible; where that does
/// not decide, the machine stamp does.
MrcHeader decode_mrc_header(const MrcHeaderBytes& bytes);

/// Encodes a header in this machine's byte order, with words 25–49 as MRC2014 has them (no skew).
MrcHeaderBytes encode_mrc_header(const MrcHeader& header);

/// True for the modes that can be read: 0, 1, 2, 6, 12, 101.
bool readable_mode(std::int32_t mode);

/// The bytes are a file of this kind, by magic or structure ("text", "an OpenVDB file"); empty where unknown.
/// For bytes that are no MRC header: some formats have no magic. `length` is the file's length where known.
std::string foreign_format(const unsigned char* bytes, std::size_t count,
                           std::optional<std::uint64_t> length);

}  // namespace vdbgeo
