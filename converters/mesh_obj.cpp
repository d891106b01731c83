// Wavefront OBJ: one statement a line, vertices counted from 1, or backwards from the latest one as -1.
#include <fmt/format.h>

#include <algorithm>

#include "converters/mesh_formats.h"
#include "converters/mesh_properties.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

/// Statements that say nothing about the triangles' shape.
constexpr std::string_view passed_over[] = {
    "vt",     "vn", "vp", "g",   "o",     "s",        "mg",       "usemtl",     "mtllib",   "usemap",
    "maplib", "l",  "p",  "lod", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj"};

struct Reader {
    TextCursor text;
    TriMesh mesh;
    std::vector<VertexId> polygon;
    // Faces may stand before their vertices: the highest number so far is checked at the end.
    std::int64_t highest = 0;
    std::size_t highest_line = 0;
    std::vector<float> colors;  // of the vertices so far, as long as all have one

    void vertex();
    void face();
    VertexId corner(std::string_view word);
};

void Reader::vertex() {
    if (mesh.points.size() == TriMesh::max_vertices) text.fail("more than 2^32-1 vertices");
    const float x = text.number("x"), y = text.number("y"), z = text.number("z");
    mesh.points.emplace_back(x, y, z);
    // Behind the coordinates may stand a weight, or red, green and blue.
    std::array<std::string_view, 3> more;
    for (std::string_view& word : more) word = text.word();
    if (more[2].empty() || colors.size() != 3 * (mesh.points.size() - 1)) return;
    for (const std::string_view word : more) colors.push_back(text.number_in(word, "colour"));
}

/// The vertex of "v", "v/vt", "v//vn" or "v/vt/vn".
VertexId Reader::corner(std::string_view word) {
    const std::size_t slash = std::min(word.find('/'), word.size());
    if (word.find_first_not_of("0123456789-/", slash) != word.npos ||
        std::count(word.begin(), word.end(), '/') > 2)
        text.fail(fmt::format("expected a corner like 1, 1/1, 1//1 or 1/1/1, found {}", in_quotes(word)));
    const std::int64_t number = text.integer_in(word.substr(0, slash), "corner");
    const std::int64_t count = static_cast<std::int64_t>(mesh.points.size());
    const std::int64_t index = number < 0 ? count + number : number - 1;
    if (number == 0 || index < 0 || index >= static_cast<std::int64_t>(TriMesh::max_vertices))
        text.fail(fmt::format("a corner names vertex {} where there are {} so far", number, count));
    if (index >= highest) {
        highest = index + 1;
        highest_line = text.line();
    }
    return static_cast<VertexId>(index);
}

void Reader::face() {
    polygon.clear();
    for (std::string_view word = text.word(); !word.empty(); word = text.word()) {
        if (word == "\\") {  // the statement goes on in the next line
            if (!text.next_line()) text.fail("the file ends within a face");
            continue;
        }
        polygon.push_back(corner(word));
    }
    if (polygon.size() < 3)
        text.fail(fmt::format("expected a face of 3 or more corners, found {}", polygon.size()));
    append_fan(polygon, mesh.triangles);
}

}  // namespace

TriMesh read_obj(const MappedFile& file, const Progress& progress) {
    Reader reader{TextCursor(file.bytes(), file.name(), '#'), {}, {}, 0, 0, {}};
    TextCursor& text = reader.text;
    for (std::size_t n = 1; text.next_line(); ++n) {
        const std::string_view statement = text.word();
        if (statement == "v")
            reader.vertex();
        else if (statement == "f" || statement == "fo")
            reader.face();
        else if (std::find(std::begin(passed_over), std::end(passed_over), statement) ==
                 std::end(passed_over))
            text.fail(fmt::format("expected a statement of a polygon mesh, found {}", in_quotes(statement)));
        if (n % report_every == 0)
            progress.report(static_cast<double>(text.offset()) / static_cast<double>(file.bytes().size()));
    }
    const std::size_t count = reader.mesh.points.size();
    if (reader.highest > static_cast<std::int64_t>(count))
        throw InvalidInput(fmt::format("{}: line {}: a corner names vertex {} of {}", file.name(),
                                       reader.highest_line, reader.highest, count));
    if (count > 0 && reader.colors.size() == 3 * count)
        reader.mesh.vertex_properties.push_back({"color", 3, std::move(reader.colors)});
    return std::move(reader.mesh);
}

void write_obj(const TriMesh& mesh, const Output& out) {
    out.file.write("# vdbgeo, coordinates in Angstrom\n");
    const MeshProperty* const color = vertex_color(mesh);
    write_elements(out.file, mesh.points.size(), out.progress.part(0, 0.5),
                   [&](std::size_t i, Buffer& buffer) {
                       buffer.append(std::string_view("v "));
                       put_point(buffer, mesh.points[i], out.options);
                       if (color) put_color(buffer, &color->values[3 * i]);
                       buffer.push_back('\n');
                   });
    write_elements(out.file, mesh.triangles.size(), out.progress.part(0.5, 1),
                   [&](std::size_t i, Buffer& buffer) {
                       const Triangle& t = mesh.triangles[i];
                       fmt::format_to(fmt::appender(buffer), "f {} {} {}\n", t[0] + std::uint64_t(1),
                                      t[1] + std::uint64_t(1), t[2] + std::uint64_t(1));
                   });
}

}  // namespace vdbgeo::mesh_formats
