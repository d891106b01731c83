// Medit's text files: a keyword, a count, and as many entries of numbers, section after section.
#include <fmt/format.h>

#include <cctype>

#include "converters/tet_formats.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::tet_formats {
namespace {

/// Sections that are passed over, and of how many numbers their entries are. Others, which are not known, are
/// passed over up to the next keyword.
struct Section {
    std::string_view name;
    std::uint64_t words;
    enum Kind { other, surface, solid } kind = other;
};
constexpr Section sections[] = {{"Triangles", 4, Section::surface},
                                {"Quadrilaterals", 5, Section::surface},
                                {"TrianglesP2", 7, Section::surface},
                                {"Hexahedra", 9, Section::solid},
                                {"Hexaedra", 9, Section::solid},
                                {"Prisms", 7, Section::solid},
                                {"Pentahedra", 7, Section::solid},
                                {"Pyramids", 6, Section::solid},
                                {"Edges", 3},
                                {"Corners", 1},
                                {"Ridges", 1},
                                {"RequiredVertices", 1},
                                {"RequiredEdges", 1},
                                {"RequiredTriangles", 1},
                                {"Normals", 3},
                                {"NormalAtVertices", 2},
                                {"Tangents", 3},
                                {"TangentAtVertices", 2}};

bool is_keyword(std::string_view word) {
    return !word.empty() && std::isupper(static_cast<unsigned char>(word[0]));  // nan is none
}

class Reader {
 public:
    Reader(const MappedFile& file, const Progress& progress)
        : bytes_(file.bytes()), text_(bytes_, file.name(), '#'), progress_(progress) {}

    TetSoup read() {
        header();
        std::string_view word = text_.next_word();
        while (!word.empty() && word != "End") word = section(word);
        // Some programs leave the word End out; then a file may have been cut.
        if (word.empty() && (soup_.tets.empty() || (bytes_.back() != '\n' && bytes_.back() != '\r')))
            text_.fail("the file ends without the word End");
        if (!vertices_) text_.fail("no section Vertices");
        for (const Tetrahedron& t : soup_.tets)
            for (const VertexId v : t)
                if (v >= soup_.points.size())
                    text_.fail(fmt::format("a tetrahedron names vertex {} of {}", std::uint64_t(v) + 1,
                                           soup_.points.size()));
        return std::move(soup_);
    }

 private:
    void header() {
        const std::string_view word = text_.next_word();
        if (word != "MeshVersionFormatted")
            text_.fail(
                fmt::format("no file of Medit: expected MeshVersionFormatted, found {}", in_quotes(word)));
        const std::int64_t version = text_.integer_in(text_.next_word(), "version");
        if (version < 1 || version > 4)
            text_.fail(fmt::format("expected a version of 1 to 4, found {}", version));
    }

    std::uint64_t count(const Section& section) {
        const std::int64_t n = text_.integer_in(text_.next_word(), "count");
        if (n < 0) text_.fail(fmt::format("{}: expected a count, found {}", section.name, n));
        const auto entries = static_cast<std::uint64_t>(n);
        const std::uint64_t bytes = 2 * section.words;  // a digit and a blank for each word at least
        if (entries > (text_.remaining() + 1) / bytes)
            text_.fail(fmt::format("{}: {} entries need {} bytes each at least, found {} bytes in all",
                                   section.name, entries, bytes, text_.remaining()));
        return entries;
    }

    /// Takes a section whose keyword was read; the next keyword.
    std::string_view section(std::string_view word) {
        if (!is_keyword(word)) text_.fail(fmt::format("expected a keyword, found {}", in_quotes(word)));
        if (word == "Dimension") {
            if (const std::int64_t d = text_.integer_in(text_.next_word(), "dimension"); d != 3)
                text_.fail(fmt::format("{} dimensions, expected 3", d));
            return text_.next_word();
        }
        if (word == "Vertices") return vertices();
        if (word == "Tetrahedra") return tetrahedra({word, 5}, 0);
        if (word == "TetrahedraP2") return tetrahedra({word, 11}, 6);
        for (const Section& known : sections)
            if (word == known.name) return pass_over(known);
        do word = text_.next_word();
        while (!word.empty() && !is_keyword(word));
        return word;
    }

    std::string_view pass_over(const Section& section) {
        const std::uint64_t entries = count(section);
        if (section.kind == Section::solid && entries > 0)
            text_.fail(fmt::format("{}: only tetrahedra are read", section.name));
        if (section.kind == Section::surface) soup_.surfaces += entries;
        for (std::uint64_t i = 0; i < entries * section.words; ++i) {
            const std::string_view word = text_.next_word();
            if (word.empty() || is_keyword(word))
                text_.fail(fmt::format("{}: {} entries of {}", section.name, i / section.words, entries));
            report(i);
        }
        return text_.next_word();
    }

    std::string_view vertices() {
        if (vertices_) text_.fail("a second section Vertices");
        vertices_ = true;
        const std::uint64_t n = count({"Vertices", 4});
        if (n > TriMesh::max_vertices) text_.fail(fmt::format("{} vertices, more than 2^32-1", n));
        soup_.points.resize(n);
        for (std::uint64_t i = 0; i < n; ++i) {
            for (int a = 0; a < 3; ++a) soup_.points[i][a] = text_.real_in(text_.next_word(), "coordinate");
            text_.real_in(text_.next_word(), "reference of the vertex");
            report(i);
        }
        return text_.next_word();
    }

    VertexId corner() {
        const std::int64_t v = text_.integer_in(text_.next_word(), "corner");
        const std::size_t known = vertices_ ? soup_.points.size() : TriMesh::max_vertices;
        if (v < 1 || static_cast<std::uint64_t>(v) > known)
            text_.fail(fmt::format("a tetrahedron names vertex {}, expected 1 to {}", v, known));
        return static_cast<VertexId>(v - 1);
    }

    /// `middles`: how many nodes follow the corners.
    std::string_view tetrahedra(const Section& section, int middles) {
        const std::uint64_t n = count(section);
        if (middles > 0 && !vertices_) text_.fail("quadratic tetrahedra before the vertices");
        soup_.tets.reserve(soup_.tets.size() + n);
        soup_.labels.reserve(soup_.labels.size() + n);
        for (std::uint64_t i = 0; i < n; ++i) {
            Tetrahedron t;
            for (VertexId& v : t) v = corner();
            for (int m = 0; m < middles; ++m) soup_.add_middle(corner());
            soup_.tets.push_back(t);
            soup_.labels.push_back(
                static_cast<double>(text_.integer_in(text_.next_word(), "reference of the tetrahedron")));
            report(i);
        }
        return text_.next_word();
    }

    void report(std::uint64_t i) const {
        if (i % report_every == 0)
            progress_.report(static_cast<double>(text_.offset()) / static_cast<double>(bytes_.size()));
    }

    std::string_view bytes_;
    TextCursor text_;
    const Progress& progress_;
    bool vertices_ = false;
    TetSoup soup_;
};

}  // namespace

TetSoup read_medit(const std::filesystem::path& path, const Progress& progress) {
    const MappedFile file(path);
    return Reader(file, progress).read();
}

void write_medit(const TetOutput& out) {
    const TetMesh& mesh = out.mesh;
    AtomicFile file(out.path);
    std::string head = "MeshVersionFormatted 2\nDimension 3\n# vdbgeo, coordinates in Angstrom\n";
    for (std::size_t g = 0; g < out.groups.size(); ++g)
        head += fmt::format("# triangles of reference {}: {}\n", g + 1, out.groups.name(g));
    file.write(head + fmt::format("\nVertices\n{}\n", mesh.points.size()));
    write_elements(file, mesh.points.size(), out.progress.part(0, 0.3), [&](std::size_t i, Buffer& buffer) {
        const Vec3d& p = mesh.points[i];
        put_line(buffer, p[0], p[1], p[2], 0);
    });
    file.write(fmt::format("\nTetrahedra\n{}\n", mesh.tets.size()));
    write_elements(file, mesh.tets.size(), out.progress.part(0.3, 0.9), [&](std::size_t i, Buffer& buffer) {
        const Tetrahedron& t = mesh.tets[i];
        put_line(buffer, t[0] + 1, t[1] + 1, t[2] + 1, t[3] + 1, mesh.region(i));
    });
    file.write(fmt::format("\nTriangles\n{}\n", mesh.faces.size()));
    write_elements(file, mesh.faces.size(), out.progress.part(0.9, 1), [&](std::size_t i, Buffer& buffer) {
        const Triangle& t = mesh.faces[i];
        put_line(buffer, t[0] + 1, t[1] + 1, t[2] + 1, out.groups.of(mesh.face_regions[i]) + 1);
    });
    file.write("\nEnd\n");
    file.commit();
}

}  // namespace vdbgeo::tet_formats
