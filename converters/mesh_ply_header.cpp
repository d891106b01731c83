#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "converters/mesh_ply.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo::mesh_formats {
namespace {

PlyType parse_type(const TextCursor& text, std::string_view word) {
    constexpr std::pair<std::string_view, PlyType> types[] = {
        {"char", PlyType::int8},      {"int8", PlyType::int8},       {"uchar", PlyType::uint8},
        {"uint8", PlyType::uint8},    {"short", PlyType::int16},     {"int16", PlyType::int16},
        {"ushort", PlyType::uint16},  {"uint16", PlyType::uint16},   {"int", PlyType::int32},
        {"int32", PlyType::int32},    {"uint", PlyType::uint32},     {"uint32", PlyType::uint32},
        {"float", PlyType::float32},  {"float32", PlyType::float32}, {"double", PlyType::float64},
        {"float64", PlyType::float64}};
    for (const auto& [name, type] : types)
        if (word == name) return type;
    text.fail(fmt::format("expected a type such as float, int or uchar, found {}", in_quotes(word)));
}

bool is_float(PlyType type) { return type == PlyType::float32 || type == PlyType::float64; }

void parse_format(TextCursor& text, PlyHeader& header) {
    const std::string_view encoding = text.word(), version = text.word();
    if (encoding == "ascii")
        header.encoding = PlyHeader::Encoding::ascii;
    else if (encoding == "binary_little_endian")
        header.encoding = PlyHeader::Encoding::little_endian;
    else if (encoding == "binary_big_endian")
        header.encoding = PlyHeader::Encoding::big_endian;
    else
        text.fail(fmt::format("expected ascii, binary_little_endian or binary_big_endian, found {}",
                              in_quotes(encoding)));
    if (version != "1.0") text.fail(fmt::format("expected version 1.0, found {}", in_quotes(version)));
    text.expect_line_end();
}

void parse_element(TextCursor& text, PlyHeader& header) {
    PlyElement element;
    element.name = text.word();
    element.line = text.line();
    const std::int64_t count = text.integer("count of the element");
    if (count < 0)
        text.fail(fmt::format("element {}: expected a count, found {}", in_quotes(element.name), count));
    if (header.find(element.name))
        text.fail(fmt::format("element {} is declared twice", in_quotes(element.name)));
    element.count = static_cast<std::uint64_t>(count);
    text.expect_line_end();
    header.elements.push_back(std::move(element));
}

void parse_property(TextCursor& text, PlyHeader& header) {
    if (header.elements.empty()) text.fail("a property before any element");
    PlyElement& element = header.elements.back();
    PlyProperty property;
    std::string_view type = text.word();
    if (type == "list") {
        property.list_count = parse_type(text, text.word());
        if (is_float(*property.list_count)) text.fail("the length of a list is no whole number");
        type = text.word();
    }
    property.type = parse_type(text, type);
    property.name = text.word();
    if (property.name.empty()) text.fail("a property without a name");
    for (const PlyProperty& other : element.properties)
        if (other.name == property.name)
            text.fail(fmt::format("property {} is declared twice", in_quotes(property.name)));
    text.expect_line_end();
    element.properties.push_back(std::move(property));
}

/// Where the body begins: after the end of the line of end_header. A lone CR ends it only where a lone CR
/// ended the first line: a binary body may begin with the byte of LF.
std::size_t body_offset(std::string_view bytes, std::size_t end_of_header) {
    const std::size_t first = bytes.find_first_of("\r\n");
    const bool pairs = bytes.substr(first, 2) == "\r\n";
    const std::size_t length = pairs && bytes.substr(end_of_header, 2) == "\r\n" ? 2 : 1;
    return std::min(end_of_header + length, bytes.size());
}

[[noreturn]] void fail(const MappedFile& file, const PlyElement& element, const std::string& message) {
    throw InvalidInput(fmt::format("{}: line {}: element {}: {}", file.name(), element.line,
                                   in_quotes(element.name), message));
}

/// The fewest bytes that an entry takes.
std::uint64_t least_bytes(const PlyElement& element, PlyHeader::Encoding encoding) {
    std::uint64_t bytes = 0;
    for (const PlyProperty& p : element.properties) {
        const std::uint64_t values = p.list_count ? (&p == element.corners() ? 3 : 0) : 1;
        if (encoding == PlyHeader::Encoding::ascii)
            bytes += 2 * (values + (p.list_count ? 1 : 0));  // a digit and what parts it from the next
        else
            bytes += values * ply_type_bytes(p.type) + (p.list_count ? ply_type_bytes(*p.list_count) : 0);
    }
    return bytes;
}

void check_sizes(const MappedFile& file, const PlyHeader& header) {
    const bool ascii = header.encoding == PlyHeader::Encoding::ascii;
    // The last line of a text may lack its end.
    std::uint64_t left = file.bytes().size() - header.body + (ascii ? 1 : 0);
    for (const PlyElement& element : header.elements) {
        if (element.count == 0) continue;
        const std::uint64_t each = least_bytes(element, header.encoding);
        if (each == 0) fail(file, element, "no property");
        if (element.count > left / each) {
            std::uint64_t needed = 0;
            if (__builtin_mul_overflow(element.count, each, &needed)) needed = UINT64_MAX;
            fail(file, element,
                 fmt::format("{} entries need {} bytes at least, found {}", element.count, needed,
                             left - (ascii ? 1 : 0)));
        }
        left -= element.count * each;
    }
}

void check_meaning(const MappedFile& file, const PlyHeader& header) {
    const PlyElement* const vertex = header.find("vertex");
    if (!vertex) throw InvalidInput(fmt::format("{}: the header declares no element 'vertex'", file.name()));
    for (const char* name : {"x", "y", "z"})
        if (std::none_of(vertex->properties.begin(), vertex->properties.end(),
                         [&](const PlyProperty& p) { return p.name == name && !p.list_count; }))
            fail(file, *vertex, fmt::format("no property '{}'", name));
    if (vertex->count > TriMesh::max_vertices)
        fail(file, *vertex, fmt::format("{} vertices, more than 2^32-1", vertex->count));
    const PlyElement* const face = header.find("face");
    if (face && face->count > 0) {
        if (!face->corners()) fail(file, *face, "no list 'vertex_indices' or 'vertex_index'");
        if (is_float(face->corners()->type)) fail(file, *face, "the corners are no whole numbers");
    }
    if (const PlyElement* const strips = header.find("tristrips"); strips && strips->count > 0)
        fail(file, *strips, "triangle strips are not read");
}

}  // namespace

std::size_t ply_type_bytes(PlyType type) {
    switch (type) {
        case PlyType::int8:
        case PlyType::uint8:
            return 1;
        case PlyType::int16:
        case PlyType::uint16:
            return 2;
        case PlyType::float64:
            return 8;
        default:
            return 4;
    }
}

const PlyProperty* PlyElement::corners() const {
    if (name != "face") return nullptr;
    for (const PlyProperty& p : properties)
        if (p.list_count && (p.name == "vertex_indices" || p.name == "vertex_index")) return &p;
    return nullptr;
}

const PlyElement* PlyHeader::find(const std::string& name) const {
    for (const PlyElement& element : elements)
        if (element.name == name) return &element;
    return nullptr;
}

PlyHeader read_ply_header(const MappedFile& file) {
    PlyHeader header;
    TextCursor text(file.bytes(), file.name());
    if (!text.next_line() || text.word() != "ply") text.fail("expected the word ply at the file's beginning");
    bool format_seen = false;
    for (;;) {
        if (!text.next_line()) text.fail("expected end_header, found the end of the file");
        const std::string_view word = text.word();
        if (word == "end_header") break;
        if (word == "comment" || word == "obj_info") continue;
        if (word == "format") {
            parse_format(text, header);
            format_seen = true;
        } else if (word == "element") {
            parse_element(text, header);
        } else if (word == "property") {
            parse_property(text, header);
        } else {
            text.fail(fmt::format("expected format, element, property, comment or end_header, found {}",
                                  in_quotes(word)));
        }
    }
    if (!format_seen) text.fail("the header has no line 'format'");
    text.skip_line();
    header.body = body_offset(file.bytes(), text.offset());
    header.body_line = text.line() + 1;
    check_sizes(file, header);
    check_meaning(file, header);
    return header;
}

}  // namespace vdbgeo::mesh_formats
