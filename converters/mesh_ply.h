// The header of a PLY file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "converters/mapped_file.h"

namespace vdbgeo::mesh_formats {

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

std::size_t ply_type_bytes(PlyType type);

struct PlyProperty {
    std::string name;
    PlyType type;                       // of the values
    std::optional<PlyType> list_count;  // of the number of values, for a list
};

struct PlyElement {
    std::string name;
    std::uint64_t count = 0;
    std::size_t line = 0;  // of the header
    std::vector<PlyProperty> properties;

    /// The list that holds a face's corners, nullptr where there is none.
    const PlyProperty* corners() const;
};

struct PlyHeader {
    enum class Encoding { ascii, little_endian, big_endian } encoding = Encoding::ascii;
    std::vector<PlyElement> elements;
    std::size_t body = 0;       // the byte after the header
    std::size_t body_line = 0;  // its line

    const PlyElement* find(const std::string& name) const;
};

/// Reads and checks the header: known types, no name twice, x, y and z of the vertices there, faces with a
/// list of corners, and a file that is long enough for all that is declared. Throws InvalidInput "FILE: line
/// N: …".
PlyHeader read_ply_header(const MappedFile& file);

}  // namespace vdbgeo::mesh_formats
