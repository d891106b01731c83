// VTK's XML files of surfaces: PolyData (.vtp) and unstructured grids whose cells are flat (.vtu).
#include <fmt/format.h>

#include <charconv>
#include <limits>
#include <utility>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "converters/vtk_piece.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

// Reading

class Reader {
 public:
    explicit Reader(const MappedFile& file) : text_(file.bytes()), file_(file.name()) {}

    TriMesh read(const Progress& progress) {
        scan();
        std::vector<TriMesh> parts;
        for (const VtkPiece& piece : pieces_)
            parts.push_back(read_piece(piece, poly_data_, encoding_, file_, progress));
        return join_parts(std::move(parts), file_);
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
        poly_data_ = type == "PolyData";
        encoding_.big_endian = tag.attribute("byte_order") == "BigEndian";
        const std::string header = tag.attribute("header_type").value_or("UInt32");
        if (header != "UInt32" && header != "UInt64")
            fail(tag, fmt::format("header_type: expected UInt32 or UInt64, found {}", in_quotes(header)));
        encoding_.header_bytes = header == "UInt64" ? 8 : 4;
        const std::string compressor = tag.attribute("compressor").value_or("");
        encoding_.zlib = compressor == "vtkZLibDataCompressor";
        if (!encoding_.zlib && !compressor.empty())
            fail(tag, fmt::format("the compressor {} is not known", in_quotes(compressor)));
    }

    void begin_piece(const XmlTag& tag) {
        pieces_.emplace_back();
        for (const char* name : {"NumberOfPoints", "NumberOfVerts", "NumberOfLines", "NumberOfStrips",
                                 "NumberOfPolys", "NumberOfCells"}) {
            const auto text = tag.attribute(name);
            if (!text) continue;
            const std::uint64_t count = whole(tag, *text, name);
            if (count > std::uint64_t(1) << 40)
                fail(tag, fmt::format("{}: {}, which no file holds", name, count));
            pieces_.back().counts[name] = count;
        }
    }

    /// Returns where the text goes on.
    std::size_t add_array(const XmlTag& tag, const std::string& section) {
        const std::size_t close = tag.empty ? tag.end : text_.find("</DataArray", tag.end);
        if (close == text_.npos) fail(tag, "the file ends within an array");
        const auto type = vtk_type(tag.attribute("type").value_or(""));
        if (pieces_.empty() || section.empty() || !type) return close;  // of the file itself, or of strings
        VtkArray array;
        array.name = tag.attribute("Name").value_or("");
        array.type = *type;
        array.format = tag.attribute("format").value_or("ascii");
        array.components =
            whole(tag, tag.attribute("NumberOfComponents").value_or("1"), "NumberOfComponents");
        array.offset = whole(tag, tag.attribute("offset").value_or("0"), "offset");
        array.text = own_text(text_.substr(tag.end, close - tag.end));
        pieces_.back().sections[section].push_back(std::move(array));
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
        encoding_.appended_base64 = tag.attribute("encoding").value_or("base64") == "base64";
        const std::size_t mark = text_.find_first_not_of(" \t\r\n", tag.end);
        if (mark == text_.npos || text_[mark] != '_') fail(tag, "no underscore before the appended values");
        encoding_.appended = text_.substr(mark + 1);
    }

    std::string_view text_;
    const std::string& file_;
    bool poly_data_ = true;
    VtkEncoding encoding_;
    std::vector<VtkPiece> pieces_;
};

// Writing

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

/// The arrays of a file: declared first, written in the same order.
class Writer {
 public:
    Writer(const TriMesh& mesh, const Output& out) : mesh_(mesh), out_(out) {
        constexpr std::uint64_t most = std::numeric_limits<std::int32_t>::max();
        index_bytes_ = mesh.points.size() > most || 3 * mesh.triangles.size() > most ? 8 : 4;
    }

    void write(bool poly_data) {
        const char* const type = poly_data ? "PolyData" : "UnstructuredGrid";
        const std::size_t points = mesh_.points.size(), faces = mesh_.triangles.size();
        text_ = fmt::format(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{0}\" version=\"1.0\" byte_order=\"LittleEndian\" "
            "header_type=\"UInt64\">\n<!-- vdbgeo, coordinates in Angstrom -->\n<{0}>\n<Piece "
            "NumberOfPoints=\"{1}\" ",
            type, points);
        text_ += poly_data ? fmt::format(
                                 "NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
                                 "NumberOfPolys=\"{}\">\n",
                                 faces)
                           : fmt::format("NumberOfCells=\"{}\">\n", faces);
        properties("PointData", mesh_.vertex_properties);
        properties("CellData", mesh_.face_properties);
        text_ += "<Points>\n";
        declare("Float32", "Points", 3, 12 * points);
        text_ += "</Points>\n";
        const char* const cells = poly_data ? "Polys" : "Cells";
        const char* const index = index_bytes_ == 8 ? "Int64" : "Int32";
        text_ += fmt::format("<{}>\n", cells);
        declare(index, "connectivity", 1, 3 * faces * index_bytes_);
        declare(index, "offsets", 1, faces * index_bytes_);
        if (!poly_data) declare("UInt8", "types", 1, faces);
        text_ += fmt::format("</{}>\n</Piece>\n</{}>\n<AppendedData encoding=\"raw\">\n_", cells, type);
        out_.file.write(text_);
        values(poly_data);
        out_.file.write("\n</AppendedData>\n</VTKFile>\n");
    }

 private:
    void declare(const char* type, const std::string& name, int components, std::uint64_t bytes) {
        text_ += fmt::format(
            "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" "
            "offset=\"{}\"/>\n",
            type, escaped(name), components, offset_);
        offset_ += 8 + bytes;
    }

    void properties(const char* section, const std::vector<MeshProperty>& all) {
        bool normals = false;
        for (const MeshProperty& p : all) normals |= p.name == "normal" && p.components == 3;
        text_ += fmt::format("<{}{}>\n", section, normals ? " Normals=\"normal\"" : "");
        for (const MeshProperty& p : all) declare("Float32", p.name, p.components, 4 * p.values.size());
        text_ += fmt::format("</{}>\n", section);
    }

    /// One array: its length and its elements.
    template <class Append>
    void array(std::size_t count, std::size_t element_bytes, const Append& append) {
        Buffer length;
        put(length, static_cast<std::uint64_t>(count) * element_bytes);
        out_.file.write(length.data(), length.size());
        write_elements(out_.file, count, out_.progress.part(done_, done_ + (1 - done_) / 2), append);
        done_ += (1 - done_) / 2;
    }

    void index(Buffer& buffer, std::uint64_t value) const {
        if (index_bytes_ == 8)
            put(buffer, value);
        else
            put(buffer, static_cast<std::uint32_t>(value));
    }

    void values(bool poly_data) {
        for (const auto* all : {&mesh_.vertex_properties, &mesh_.face_properties})
            for (const MeshProperty& p : *all)
                array(p.values.size(), 4, [&](std::size_t i, Buffer& buffer) { put(buffer, p.values[i]); });
        array(mesh_.points.size(), 12, [&](std::size_t i, Buffer& buffer) {
            for (const float c : mesh_.points[i]) put(buffer, c);
        });
        const std::size_t faces = mesh_.triangles.size();
        array(faces, 3 * index_bytes_, [&](std::size_t i, Buffer& buffer) {
            for (const VertexId v : mesh_.triangles[i]) index(buffer, v);
        });
        array(faces, index_bytes_, [&](std::size_t i, Buffer& buffer) { index(buffer, 3 * i + 3); });
        if (!poly_data) array(faces, 1, [&](std::size_t, Buffer& buffer) { put(buffer, std::uint8_t(5)); });
    }

    const TriMesh& mesh_;
    const Output& out_;
    std::size_t index_bytes_;
    std::string text_;
    std::uint64_t offset_ = 0;
    double done_ = 0;
};

void write_xml(const TriMesh& mesh, const Output& out, bool poly_data) {
    check_names(mesh.vertex_properties, out.name, "VTK");
    check_names(mesh.face_properties, out.name, "VTK");
    Writer(mesh, out).write(poly_data);
}

}  // namespace

bool is_vtk_xml(std::string_view bytes) {
    const std::size_t first = bytes.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
    return first != bytes.npos && bytes[first] == '<' && bytes.substr(0, 2000).find("<VTKFile") != bytes.npos;
}

TriMesh read_vtk_xml(const MappedFile& file, const Progress& progress) {
    TriMesh mesh = Reader(file).read(progress);
    progress.report(0.9);
    return mesh;
}

void write_vtp(const TriMesh& mesh, const Output& out) { write_xml(mesh, out, true); }

void write_vtu(const TriMesh& mesh, const Output& out) { write_xml(mesh, out, false); }

}  // namespace vdbgeo::mesh_formats
