#include "converters/vtk_xml.h"

#include <fmt/format.h>

#include <charconv>

#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

/// Walks over the tags and notes what they declare.
class Scanner {
 public:
    explicit Scanner(const MappedFile& file) : text_(file.bytes()), file_(file.name()) {}

    VtkFile file() {
        scan();
        return std::move(out_);
    }

 private:
    [[noreturn]] void fail(const XmlTag& tag, const std::string& message) const {
        throw InvalidInput(fmt::format("{}: byte {}: {}", file_, tag.begin, message));
    }
    std::uint64_t whole(const XmlTag& tag, const std::string& text, const char* what) const {
        std::uint64_t value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (error != std::errc() || end != text.data() + text.size())
            fail(tag, fmt::format("{}: expected a whole number, found {}", what, in_quotes(text)));
        return value;
    }

    void scan() {
        bool told = false, ended = false;
        std::string section;
        for (auto tag = next_tag(text_, 0); tag && !ended; tag = next_tag(text_, tag->end)) {
            if (tag->name == "VTKFile") {
                if (!tag->closing) begin_file(*tag);
                told = true;
                ended = tag->closing;
            } else if (!told) {
                break;
            } else if (tag->name == "Piece" && !tag->closing) {
                begin_piece(*tag);
            } else if (tag->name == "DataArray" && !tag->closing) {
                const std::size_t end = add_array(*tag, section);
                tag->end = end;
            } else if (tag->name == "AppendedData" && !tag->closing) {
                begin_appended(*tag);
                return;  // what follows is no XML
            } else if (!tag->closing && !tag->empty) {
                section = tag->name;  // whose arrays follow
            } else if (tag->closing && tag->name == section) {
                section.clear();
            }
        }
        if (!told) throw InvalidInput(fmt::format("{}: no file of VTK: no element VTKFile", file_));
        if (!ended) throw InvalidInput(fmt::format("{}: the file ends before </VTKFile>", file_));
    }

    void begin_file(const XmlTag& tag) {
        const std::string type = tag.attribute("type").value_or("");
        if (type != "PolyData" && type != "UnstructuredGrid")
            fail(tag, fmt::format("expected PolyData or an UnstructuredGrid, found {}", in_quotes(type)));
        out_.poly_data = type == "PolyData";
        out_.encoding.big_endian = tag.attribute("byte_order") == "BigEndian";
        const std::string header = tag.attribute("header_type").value_or("UInt32");
        if (header != "UInt32" && header != "UInt64")
            fail(tag, fmt::format("header_type: expected UInt32 or UInt64, found {}", in_quotes(header)));
        out_.encoding.header_bytes = header == "UInt64" ? 8 : 4;
        const std::string compressor = tag.attribute("compressor").value_or("");
        out_.encoding.zlib = compressor == "vtkZLibDataCompressor";
        if (!out_.encoding.zlib && !compressor.empty())
            fail(tag, fmt::format("the compressor {} is not known", in_quotes(compressor)));
    }

    void begin_piece(const XmlTag& tag) {
        out_.pieces.emplace_back();
        for (const char* name : {"NumberOfPoints", "NumberOfVerts", "NumberOfLines", "NumberOfStrips",
                                 "NumberOfPolys", "NumberOfCells"}) {
            const auto text = tag.attribute(name);
            if (!text) continue;
            const std::uint64_t count = whole(tag, *text, name);
            if (count > std::uint64_t(1) << 40)
                fail(tag, fmt::format("{}: {}, which no file holds", name, count));
            out_.pieces.back().counts[name] = count;
        }
    }

    /// Returns where the text goes on.
    std::size_t add_array(const XmlTag& tag, const std::string& section) {
        const std::size_t close = tag.empty ? tag.end : text_.find("</DataArray", tag.end);
        if (close == text_.npos) fail(tag, "the file ends within an array");
        const auto type = vtk_type(tag.attribute("type").value_or(""));
        if (out_.pieces.empty() || section.empty() || !type)
            return close;  // of the file itself, or of strings
        VtkArray array;
        array.name = tag.attribute("Name").value_or("");
        array.type = *type;
        array.format = tag.attribute("format").value_or("ascii");
        array.components =
            whole(tag, tag.attribute("NumberOfComponents").value_or("1"), "NumberOfComponents");
        array.offset = whole(tag, tag.attribute("offset").value_or("0"), "offset");
        array.text = own_text(text_.substr(tag.end, close - tag.end));
        out_.pieces.back().sections[section].push_back(std::move(array));
        return close;
    }

    /// The values of an array stand before or behind the elements that it may hold (VTK's InformationKey).
    static std::string_view own_text(std::string_view content) {
        const std::size_t first = content.find('<');
        if (first == content.npos) return content;
        const bool before = content.find_first_not_of(" \t\r\n") < first;
        return before ? content.substr(0, first) : content.substr(content.rfind('>') + 1);
    }

    void begin_appended(const XmlTag& tag) {
        out_.encoding.appended_base64 = tag.attribute("encoding").value_or("base64") == "base64";
        const std::size_t mark = text_.find_first_not_of(" \t\r\n", tag.end);
        if (mark == text_.npos || text_[mark] != '_') fail(tag, "no underscore before the appended values");
        out_.encoding.appended = text_.substr(mark + 1);
    }

    std::string_view text_;
    const std::string& file_;
    VtkFile out_;
};

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text)
        out += c == '<'   ? "&lt;"
               : c == '>' ? "&gt;"
               : c == '&' ? "&amp;"
               : c == '"' ? "&quot;"
                          : std::string(1, c);
    return out;
}

}  // namespace

VtkFile scan_vtk_xml(const MappedFile& file) { return Scanner(file).file(); }

VtkWriter::VtkWriter(AtomicFile& file, std::string type, const std::string& counts)
    : file_(file), type_(std::move(type)) {
    text_ = fmt::format(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"{0}\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\">\n<!-- vdbgeo, coordinates in Angstrom -->\n<{0}>\n<Piece {1}>\n",
        type_, counts);
}

void VtkWriter::begin(const std::string& section, const std::string& attributes) {
    text_ += fmt::format("<{}{}>\n", section, attributes);
}

void VtkWriter::declare(const char* type, const std::string& name, int components, std::uint64_t bytes) {
    // One component is what goes without saying: some readers make columns of what is said to have one.
    text_ += fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" {}format=\"appended\" offset=\"{}\"/>\n", type, escaped(name),
        components == 1 ? "" : fmt::format("NumberOfComponents=\"{}\" ", components), offset_);
    offset_ += 8 + bytes;
}

void VtkWriter::property(const MeshProperty& p) {
    array("Float32", p.name, p.components, p.values.size(), 4,
          [&p](std::size_t i, Buffer& buffer) { put(buffer, p.values[i]); });
}

void VtkWriter::write(const Progress& progress) {
    text_ += fmt::format("</Piece>\n</{}>\n<AppendedData encoding=\"raw\">\n_", type_);
    file_.write(text_);
    const auto part = [&](std::uint64_t bytes) {
        return static_cast<double>(bytes) / static_cast<double>(offset_);
    };
    std::uint64_t done = 0;
    for (std::size_t a = 0; a < values_.size(); ++a) {
        Buffer length;
        put(length, lengths_[a]);
        file_.write(length.data(), length.size());
        const std::uint64_t end = done + length.size() + lengths_[a];
        values_[a](progress.part(part(done), part(end)));
        done = end;
    }
    file_.write("\n</AppendedData>\n</VTKFile>\n");
}

}  // namespace vdbgeo::mesh_formats
