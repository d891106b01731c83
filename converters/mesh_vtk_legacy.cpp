// VTK's old files of PolyData (.vtk), as text or binary: read only.
#include <fmt/format.h>

#include <cctype>
#include <charconv>
#include <deque>
#include <utility>

#include "converters/mesh_formats.h"
#include "converters/text_cursor.h"
#include "converters/vtk_piece.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

constexpr std::string_view blanks = " \t\r\n";

/// The type that a word of an old file names.
std::optional<VtkType> old_type(std::string_view word) {
    constexpr std::pair<std::string_view, VtkType> types[] = {
        {"unsigned_char", {'u', 1}}, {"char", {'i', 1}},          {"unsigned_short", {'u', 2}},
        {"short", {'i', 2}},         {"unsigned_int", {'u', 4}},  {"int", {'i', 4}},
        {"float", {'f', 4}},         {"double", {'f', 8}},        {"vtktypeint64", {'i', 8}},
        {"vtkIdType", {'i', 4}},     {"unsigned_long", {'u', 8}}, {"long", {'i', 8}}};
    for (const auto& [name, type] : types)
        if (word == name) return type;
    return {};
}

/// Goes through a file and notes where its arrays are.
class Scanner {
 public:
    explicit Scanner(const MappedFile& file) : text_(file.bytes()), file_(file.name()) {}

    TriMesh read(const Progress& progress) {
        line();
        line();  // the title
        const std::string_view kind = word();
        binary_ = kind == "BINARY";
        if (!binary_ && kind != "ASCII")
            fail(fmt::format("expected ASCII or BINARY, found {}", in_quotes(kind)));
        if (word() != "DATASET" || word() != "POLYDATA")
            fail("expected DATASET POLYDATA: only surfaces are read");
        for (std::string_view keyword = word(); !keyword.empty(); keyword = word()) take(keyword);
        VtkEncoding encoding;
        encoding.big_endian = true;
        encoding.header_bytes = 0;
        encoding.appended = text_;
        return read_piece(piece_, true, encoding, file_, progress);
    }

 private:
    [[noreturn]] void fail(const std::string& message) const {
        throw InvalidInput(fmt::format("{}: byte {}: {}", file_, at_, message));
    }
    std::string_view line() {
        const std::size_t end = std::min(text_.find('\n', at_), text_.size());
        const std::string_view found = text_.substr(at_, end - at_);
        at_ = std::min(end + 1, text_.size());
        return found;
    }
    std::string_view word() {
        at_ = std::min(text_.find_first_not_of(blanks, at_), text_.size());
        const std::size_t end = std::min(text_.find_first_of(blanks, at_), text_.size());
        return text_.substr(std::exchange(at_, end), end - at_);
    }
    std::uint64_t whole(std::string_view found) const {
        std::uint64_t value = 0;
        const auto [end, error] = std::from_chars(found.data(), found.data() + found.size(), value);
        if (error != std::errc() || end != found.data() + found.size() || value > std::uint64_t(1) << 40)
            fail(fmt::format("expected a count, found {}", in_quotes(found)));
        return value;
    }
    VtkType type(std::string_view found) const {
        const auto known = old_type(found);
        if (!known) fail(fmt::format("expected a type such as float or int, found {}", in_quotes(found)));
        return *known;
    }

    /// The values that follow, as an array.
    VtkArray values(std::string name, VtkType type, std::uint64_t components, std::uint64_t tuples) {
        VtkArray array{std::move(name), type, components, binary_ ? "appended" : "ascii", 0, {}};
        std::uint64_t count = 0, bytes = 0;
        if (__builtin_mul_overflow(components, tuples, &count) ||
            __builtin_mul_overflow(count, type.bytes, &bytes))
            fail(fmt::format("{} values of {} components, which no file holds", tuples, components));
        if (binary_) {
            if (count > 0) line();  // the rest of the line of the keyword
            if (bytes > text_.size() - at_)
                fail(fmt::format("{} bytes, found {}", bytes, text_.size() - at_));
            array.offset = at_;
            at_ += bytes;
            return array;
        }
        const std::size_t begin = at_;
        for (std::uint64_t i = 0; i < count; ++i)
            if (word().empty()) fail(fmt::format("the file ends at value {} of {}", i, count));
        array.text = text_.substr(begin, at_ - begin);
        return array;
    }

    void take(std::string_view keyword) {
        if (keyword == "POINTS") {
            const std::uint64_t count = whole(word());
            const VtkType own = type(word());
            piece_.counts["NumberOfPoints"] = count;
            piece_.sections["Points"].push_back(values("Points", own, 3, count));
        } else if (keyword == "POLYGONS") {
            cells("Polys", "NumberOfPolys");
        } else if (keyword == "TRIANGLE_STRIPS") {
            cells("Strips", "NumberOfStrips");
        } else if (keyword == "LINES") {
            cells("Lines", "NumberOfLines");
        } else if (keyword == "VERTICES") {
            cells("Verts", "NumberOfVerts");
        } else if (keyword == "POINT_DATA" || keyword == "CELL_DATA") {
            section_ = keyword == "POINT_DATA" ? "PointData" : "CellData";
            tuples_ = whole(word());
        } else if (keyword == "METADATA") {  // up to an empty line
            line();
            while (at_ < text_.size() && line().find_first_not_of(blanks) != std::string_view::npos) {
            }
        } else {
            attribute(keyword);
        }
    }

    /// "n size" and, for each cell, its number of corners and the corners; or, since version 5.1, offsets
    /// (one more than cells) and corners in arrays of their own.
    void cells(const char* section, const char* counter) {
        const std::uint64_t count = whole(word()), size = whole(word());
        const std::size_t here = at_;
        const bool arrays = word() == "OFFSETS";
        std::string corners, ends;
        std::uint64_t cells = count;
        if (arrays) {
            const VtkType offset_type = type(word());
            const std::vector<std::int64_t> offsets =
                integers(values("offsets", offset_type, 1, count), count);
            if (word() != "CONNECTIVITY") fail("expected CONNECTIVITY");
            const VtkType corner_type = type(word());
            for (const std::int64_t v : integers(values("connectivity", corner_type, 1, size), size))
                corners += fmt::format("{} ", v);
            cells = count > 0 ? count - 1 : 0;
            for (std::uint64_t i = 1; i < count; ++i) ends += fmt::format("{} ", offsets[i]);
        } else {
            at_ = here;
            const std::vector<std::int64_t> all = integers(values(section, {'i', 4}, 1, size), size);
            std::uint64_t at = 0, end = 0;
            for (std::uint64_t c = 0; c < count; ++c) {
                if (at >= all.size() || all[at] < 0 ||
                    static_cast<std::uint64_t>(all[at]) > all.size() - at - 1)
                    fail(fmt::format("{}: cell {} reaches beyond the {} values", section, c, size));
                const std::uint64_t n = static_cast<std::uint64_t>(all[at++]);
                for (std::uint64_t k = 0; k < n; ++k) corners += fmt::format("{} ", all[at++]);
                ends += fmt::format("{} ", end += n);
            }
        }
        piece_.counts[counter] = cells;
        piece_.sections[section].push_back(
            {"connectivity", {'i', 8}, 1, "ascii", 0, keep(std::move(corners))});
        piece_.sections[section].push_back({"offsets", {'i', 8}, 1, "ascii", 0, keep(std::move(ends))});
    }

    std::vector<std::int64_t> integers(const VtkArray& array, std::uint64_t count) const {
        VtkEncoding encoding;
        encoding.big_endian = true;
        encoding.header_bytes = 0;
        encoding.appended = text_;
        const VtkValues decoded = vtk_values(array, encoding, count, file_);
        std::vector<std::int64_t> out(count);
        for (std::uint64_t i = 0; i < count; ++i) out[i] = decoded.integer(i);
        return out;
    }

    std::string_view keep(std::string text) { return kept_.emplace_back(std::move(text)); }

    void attribute(std::string_view keyword) {
        const std::string name(word());
        if (keyword == "FIELD") {
            const std::uint64_t arrays = whole(word());
            for (std::uint64_t i = 0; i < arrays; ++i) {
                std::string own(word());
                if (own == "METADATA") {
                    take(own);
                    own = word();
                }
                const std::uint64_t components = whole(word()), tuples = whole(word());
                const VtkArray array = values(own, type(word()), components, tuples);
                if (!section_.empty() && tuples == tuples_) piece_.sections[section_].push_back(array);
            }
            return;
        }
        if (section_.empty()) fail(fmt::format("{} is not read here", in_quotes(keyword)));
        if (keyword == "LOOKUP_TABLE") {
            values(name, {binary_ ? 'u' : 'f', binary_ ? std::size_t(1) : 4}, 4, whole(word()));
            return;
        }
        std::uint64_t components = keyword == "TENSORS" ? 9 : 3;
        VtkType own;
        if (keyword == "COLOR_SCALARS") {
            components = whole(word());
            own = {binary_ ? 'u' : 'f', binary_ ? std::size_t(1) : 4};
        } else if (keyword == "TEXTURE_COORDINATES") {
            components = whole(word());
            own = type(word());
        } else if (keyword == "SCALARS") {
            own = type(word());
            const std::size_t end = std::min(text_.find('\n', at_), text_.size());
            components = 1;
            if (text_.find_first_not_of(" \t\r", at_) < end) components = whole(word());
            if (word() != "LOOKUP_TABLE") fail("expected LOOKUP_TABLE behind SCALARS");
            word();
        } else if (keyword == "VECTORS" || keyword == "NORMALS" || keyword == "TENSORS") {
            own = type(word());
        } else {
            fail(fmt::format("{} is not known", in_quotes(keyword)));
        }
        piece_.sections[section_].push_back(values(name, own, components, tuples_));
    }

    std::string_view text_;
    const std::string& file_;
    std::size_t at_ = 0;
    bool binary_ = false;
    VtkPiece piece_;
    std::deque<std::string> kept_;  // texts that arrays point to
    std::string section_;
    std::uint64_t tuples_ = 0;
};

}  // namespace

bool is_vtk_legacy(std::string_view bytes) { return bytes.substr(0, 22) == "# vtk DataFile Version"; }

TriMesh read_vtk_legacy(const MappedFile& file, const Progress& progress) {
    return Scanner(file).read(progress);
}

}  // namespace vdbgeo::mesh_formats
