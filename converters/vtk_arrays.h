// The parts of a VTK XML file: tags, and arrays of values in each of the encodings.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "converters/mapped_file.h"

namespace vdbgeo::mesh_formats {

/// A tag of an XML text, comments and instructions passed over.
struct XmlTag {
    std::string_view name, attributes;
    bool closing = false, empty = false;  ///< </name>, <name/>
    std::size_t begin = 0, end = 0;       ///< in the text

    /// The value of an attribute, with the five entities of XML replaced.
    std::optional<std::string> attribute(std::string_view name) const;
};

/// The next tag at or after `from`, nothing at the end of the text.
std::optional<XmlTag> next_tag(std::string_view text, std::size_t from);

/// A type of numbers: 'i', 'u' or 'f' and its bytes.
struct VtkType {
    char kind = 'f';
    std::size_t bytes = 4;
};

/// "Int8" … "Float64"; nothing for other words.
std::optional<VtkType> vtk_type(std::string_view name);

/// How a file keeps its arrays.
struct VtkEncoding {
    bool big_endian = false;
    std::size_t header_bytes = 4;  ///< of a length; 0: arrays have none, their size is the one expected
    bool zlib = false;
    bool appended_base64 = false;
    std::string_view appended;  ///< what stands behind the underscore; empty where there is none
};

/// A DataArray as it is declared.
struct VtkArray {
    std::string name;
    VtkType type;
    std::uint64_t components = 1;
    std::string format;        ///< ascii, binary or appended
    std::uint64_t offset = 0;  ///< of an appended one
    std::string_view text;     ///< of the others
};

/// The values of an array.
class VtkValues {
 public:
    std::uint64_t size() const { return size_; }
    float number(std::uint64_t i) const;
    double real(std::uint64_t i) const;
    /// Fractions are cut off, what no integer holds is the lowest one.
    std::int64_t integer(std::uint64_t i) const;

 private:
    friend VtkValues vtk_values(const VtkArray&, const VtkEncoding&, std::optional<std::uint64_t>,
                                const std::string&);
    const char* data() const { return owned_.empty() ? bytes_.data() : owned_.data(); }

    VtkType type_;
    bool swap_ = false;
    std::uint64_t size_ = 0;
    std::string_view bytes_;
    std::string owned_;  // where they do not stand in the file as they are
};

/// Decodes an array; `expected`: how many values it must have. Throws InvalidInput "FILE: array 'name': …".
/// Lengths are compared with the bytes that are there before memory is taken.
VtkValues vtk_values(const VtkArray& array, const VtkEncoding& encoding,
                     std::optional<std::uint64_t> expected, const std::string& file);

}  // namespace vdbgeo::mesh_formats
