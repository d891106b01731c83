// OFF, the text format of Geomview: a keyword, the counts, a line for each vertex and each face.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

/// The first word of a file, like "CNOFF", taken apart.
struct Keyword {
    bool normals = false;          // N: each vertex has a normal after its position
    bool colors = false;           // C: and a colour after these
    bool other_dimension = false;  // 4 or n: points are not in space
    std::string_view rest;         // files are seen whose counts follow without a blank: "OFF490 518 0"
};

std::optional<Keyword> parse_keyword(std::string_view word) {
    Keyword keyword;
    const auto take = [&](std::string_view prefix) {
        const bool found = word.substr(0, prefix.size()) == prefix;
        if (found) word.remove_prefix(prefix.size());
        return found;
    };
    take("ST");
    keyword.colors = take("C");
    keyword.normals = take("N");
    keyword.other_dimension = take("4");
    keyword.other_dimension |= take("n");
    if (!take("OFF") || (!word.empty() && !std::isdigit(static_cast<unsigned char>(word[0])))) return {};
    keyword.rest = word;
    return keyword;
}

struct Counts {
    std::uint64_t vertices, faces;
};

class Reader {
 public:
    explicit Reader(const MappedFile& file)
        : text_(file.bytes(), file.name(), '#'), size_(file.bytes().size()) {}
    TriMesh read(const Progress& progress);

 private:
    Counts header();
    std::uint64_t count(std::string_view word, const char* what) const;
    void check_size(const Counts& counts) const;
    void line(const char* what, std::uint64_t number, std::uint64_t of);
    void vertex();
    void face();
    void report(const Progress& progress, std::uint64_t n) const {
        if (n % report_every == 0)
            progress.report(static_cast<double>(text_.offset()) / static_cast<double>(size_));
    }

    TextCursor text_;
    std::size_t size_;
    bool normals_ = false, colors_ = false;
    TriMesh mesh_;
    std::vector<VertexId> polygon_;
};

std::uint64_t Reader::count(std::string_view word, const char* what) const {
    const std::int64_t n = text_.integer_in(word, what);
    if (n < 0) text_.fail(fmt::format("{}: expected a count, found {}", what, n));
    return static_cast<std::uint64_t>(n);
}

Counts Reader::header() {
    if (!text_.next_line()) text_.fail("expected the word OFF, found the end of the file");
    std::string_view word = text_.word();
    if (const auto keyword = parse_keyword(word)) {  // the format allows to leave it out
        if (keyword->other_dimension)
            text_.fail(fmt::format("{}: only points in space are read", in_quotes(word)));
        normals_ = keyword->normals;
        colors_ = keyword->colors;
        word = keyword->rest.empty() ? text_.word() : keyword->rest;
        if (word.empty() && text_.next_line()) word = text_.word();
        if (word == "BINARY") text_.fail("binary OFF files are not read");
        if (word.empty()) text_.fail("expected the counts of vertices and faces, found the end of the file");
    }
    const std::uint64_t vertices = count(word, "count of vertices");
    word = text_.word();
    if (word.empty()) text_.fail("count of faces is missing");
    const std::uint64_t faces = count(word, "count of faces");
    text_.skip_line();  // the count of edges, often 0 or absent, is not needed
    return {vertices, faces};
}

void Reader::check_size(const Counts& counts) const {
    // "0 0 0" and "3 0 0 0", each with an end of line that the last may lack
    constexpr std::uint64_t vertex_bytes = 6, face_bytes = 8;
    const std::uint64_t left = text_.remaining() + 1;
    const bool fits = counts.vertices <= left / vertex_bytes &&
                      counts.faces <= (left - counts.vertices * vertex_bytes) / face_bytes;
    if (!fits)
        text_.fail(
            fmt::format("{} vertices and {} faces need {} and {} bytes each at least, found {} bytes in all",
                        counts.vertices, counts.faces, vertex_bytes, face_bytes, text_.remaining()));
    if (counts.vertices > TriMesh::max_vertices)
        text_.fail(fmt::format("{} vertices, more than 2^32-1", counts.vertices));
}

void Reader::line(const char* what, std::uint64_t number, std::uint64_t of) {
    if (!text_.next_line())
        text_.fail(fmt::format("the file ends where {} {} of {} is expected", what, number + 1, of));
}

void Reader::vertex() {
    const float x = text_.number("x"), y = text_.number("y"), z = text_.number("z");
    mesh_.points.emplace_back(x, y, z);
    if (normals_)
        for (const char* name : {"x of the normal", "y of the normal", "z of the normal"})
            mesh_.vertex_properties[0].values.push_back(text_.number(name));
    if (colors_)
        for (const char* name : {"red", "green", "blue"})
            mesh_.vertex_properties.back().values.push_back(text_.number(name));
}

void Reader::face() {
    const std::int64_t corners = text_.integer("number of corners");
    if (corners < 3 || static_cast<std::uint64_t>(corners) > text_.remaining())
        text_.fail(
            fmt::format("expected a face of 3 or more corners that the line holds, found {}", corners));
    polygon_.clear();
    for (std::int64_t k = 0; k < corners; ++k) {
        const std::int64_t v = text_.integer("corner");
        if (v < 0 || v >= static_cast<std::int64_t>(mesh_.points.size()))
            text_.fail(fmt::format("a corner names vertex {}, expected 0 to {}", v,
                                   static_cast<std::int64_t>(mesh_.points.size()) - 1));
        polygon_.push_back(static_cast<VertexId>(v));
    }
    append_fan(polygon_, mesh_.triangles);  // what follows is a colour
}

/// The format has 0…1; many write 0…255.
void scale_colors(std::vector<float>& values) {
    if (std::none_of(values.begin(), values.end(), [](float v) { return v > 1; })) return;
    for (float& v : values) v *= 1.0f / 255;
}

TriMesh Reader::read(const Progress& progress) {
    const Counts counts = header();
    check_size(counts);
    if (normals_) mesh_.vertex_properties.push_back({"normal", 3, {}});
    if (colors_) mesh_.vertex_properties.push_back({"color", 3, {}});
    mesh_.points.reserve(counts.vertices);
    for (std::uint64_t i = 0; i < counts.vertices; ++i) {
        line("vertex", i, counts.vertices);
        vertex();
        report(progress, i);
    }
    if (colors_) scale_colors(mesh_.vertex_properties.back().values);
    mesh_.triangles.reserve(counts.faces);
    for (std::uint64_t i = 0; i < counts.faces; ++i) {
        line("face", i, counts.faces);
        face();
        report(progress, i);
    }
    if (text_.next_line())
        text_.fail(fmt::format("expected the end of the file, found {}", in_quotes(text_.word())));
    return std::move(mesh_);
}

}  // namespace

bool is_off(std::string_view bytes) {
    TextCursor text(bytes, "", '#');
    return text.next_line() && parse_keyword(text.word());
}

TriMesh read_off(const MappedFile& file, const Progress& progress) { return Reader(file).read(progress); }

void write_off(const TriMesh& mesh, const Output& out) {
    const MeshProperty* const color = vertex_color(mesh);
    out.file.write(
        fmt::format("{}OFF\n{} {} 0\n", color ? "C" : "", mesh.points.size(), mesh.triangles.size()));
    write_elements(out.file, mesh.points.size(), out.progress.part(0, 0.5),
                   [&](std::size_t i, Buffer& buffer) {
                       put_point(buffer, mesh.points[i], out.options);
                       if (color) {
                           put_color(buffer, &color->values[3 * i]);
                           buffer.append(std::string_view(" 1"));  // opaque
                       }
                       buffer.push_back('\n');
                   });
    write_elements(out.file, mesh.triangles.size(), out.progress.part(0.5, 1),
                   [&](std::size_t i, Buffer& buffer) {
                       const Triangle& t = mesh.triangles[i];
                       fmt::format_to(fmt::appender(buffer), "3 {} {} {}\n", t[0], t[1], t[2]);
                   });
}

}  // namespace vdbgeo::mesh_formats
