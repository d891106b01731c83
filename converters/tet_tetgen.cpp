// TetGen's files: points in FILE.node, tetrahedra in FILE.ele, triangles in FILE.face.
#include <fmt/format.h>

#include <cctype>

#include "converters/tet_formats.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::tet_formats {
namespace {

/// The file beside `path` with another ending, in upper case where that of `path` is.
std::filesystem::path sibling(const std::filesystem::path& path, std::string ending) {
    if (std::isupper(static_cast<unsigned char>(path.extension().string().back())))
        for (char& c : ending) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return std::filesystem::path(path).replace_extension(ending);
}

/// One of the files: a line of counts, then a line for each entry, which begins with its number.
class EntryReader {
 public:
    EntryReader(const std::filesystem::path& path, const Progress& progress)
        : file_(path), text_(file_.bytes(), file_.name(), '#'), progress_(progress) {
        if (!text_.next_line()) text_.fail("the file is empty");
    }

    /// A count of the first line; `otherwise` where the line ends before it.
    std::uint64_t count(const char* what, std::int64_t otherwise) {
        const std::string_view word = text_.word();
        if (word.empty() && otherwise < 0) text_.fail(fmt::format("{} is missing", what));
        const std::int64_t n = word.empty() ? otherwise : text_.integer_in(word, what);
        if (n < 0) text_.fail(fmt::format("{}: expected a count, found {}", what, n));
        return static_cast<std::uint64_t>(n);
    }

    /// Compares `entries` of `words` numbers each with the file's length.
    void check_room(std::uint64_t entries, std::uint64_t words) const {
        const std::uint64_t left = text_.remaining() + 1;
        if (entries > 0 && (words > left || entries > left / (2 * words)))
            text_.fail(
                fmt::format("{} entries of {} numbers, found {} bytes", entries, words, text_.remaining()));
    }

    /// Goes to entry i of n and checks its number, which is counted from `base` (found with the first entry
    /// where it is not set).
    void entry(std::uint64_t i, std::uint64_t n, std::optional<std::int64_t>& base) {
        if (!text_.next_line())
            text_.fail(fmt::format("the file ends where entry {} of {} is expected", i + 1, n));
        const std::int64_t number = text_.integer("number");
        if (!base) {
            if (number != 0 && number != 1)
                text_.fail(fmt::format("the first number is {}, expected 0 or 1", number));
            base = number;
        }
        if (number != *base + static_cast<std::int64_t>(i))
            text_.fail(fmt::format("entry {} is numbered {}", *base + static_cast<std::int64_t>(i), number));
        if (i % report_every == 0)
            progress_.report(static_cast<double>(text_.offset()) / static_cast<double>(file_.bytes().size()));
    }

    /// Fails unless all lines were read.
    void expect_end() {
        if (text_.next_line())
            text_.fail(fmt::format("expected the end of the file, found {}", in_quotes(text_.word())));
    }

    TextCursor& text() { return text_; }

 private:
    MappedFile file_;
    TextCursor text_;
    Progress progress_;
};

/// Reads the points; sets what they are counted from.
Array<Vec3d> read_points(const std::filesystem::path& path, std::optional<std::int64_t>& base,
                         const Progress& progress) {
    EntryReader in(path, progress);
    const std::uint64_t n = in.count("count of points", -1);
    if (const std::uint64_t d = in.count("dimension", 3); d != 3)
        in.text().fail(fmt::format("{} dimensions, expected 3", d));
    in.check_room(n, 4);
    if (n > TriMesh::max_vertices) in.text().fail(fmt::format("{} points, more than 2^32-1", n));
    Array<Vec3d> points(n);
    for (std::uint64_t i = 0; i < n; ++i) {
        in.entry(i, n, base);
        for (int a = 0; a < 3; ++a) points[i][a] = in.text().real("coordinate");
    }  // what follows are attributes and a marker
    in.expect_end();
    return points;
}

void read_elements(const std::filesystem::path& path, std::optional<std::int64_t> base, TetSoup& soup,
                   const Progress& progress) {
    EntryReader in(path, progress);
    const std::uint64_t n = in.count("count of tetrahedra", -1),
                        nodes = in.count("nodes of a tetrahedron", 4),
                        attributes = in.count("count of attributes", 0);
    if (nodes != 4 && nodes != 10)
        in.text().fail(fmt::format("expected tetrahedra of 4 or 10 nodes, found {}", nodes));
    in.check_room(n, 1 + nodes + (attributes > 0));
    soup.tets.resize(n);
    soup.labels.resize(attributes > 0 ? n : 0);
    for (std::uint64_t i = 0; i < n; ++i) {
        in.entry(i, n, base);
        for (std::uint64_t k = 0; k < nodes; ++k) {
            const std::int64_t v = in.text().integer("node") - *base;
            if (v < 0 || static_cast<std::uint64_t>(v) >= soup.points.size())
                in.text().fail(fmt::format("a tetrahedron names point {}; there are {}, counted from {}",
                                           v + *base, soup.points.size(), *base));
            if (k < 4)
                soup.tets[i][k] = static_cast<VertexId>(v);
            else
                soup.add_middle(static_cast<std::uint64_t>(v));
        }
        if (attributes > 0) soup.labels[i] = in.text().real("attribute");
    }
    in.expect_end();
}

}  // namespace

TetSoup read_tetgen(const std::filesystem::path& path, const Progress& progress) {
    TetSoup soup;
    std::optional<std::int64_t> base;
    soup.points = read_points(sibling(path, ".node"), base, progress.part(0, 0.3));
    read_elements(sibling(path, ".ele"), base, soup, progress.part(0.3, 1));
    return soup;
}

void write_tetgen(const TetOutput& out) {
    const TetMesh& mesh = out.mesh;
    AtomicFile node(sibling(out.path, ".node")), ele(sibling(out.path, ".ele")),
        face(sibling(out.path, ".face"));
    node.write(fmt::format("{} 3 0 0\n", mesh.points.size()));
    write_elements(node, mesh.points.size(), out.progress.part(0, 0.3), [&](std::size_t i, Buffer& buffer) {
        const Vec3d& p = mesh.points[i];
        put_line(buffer, i + 1, p[0], p[1], p[2]);
    });
    node.write("# vdbgeo, coordinates in Angstrom\n");
    ele.write(fmt::format("{} 4 1\n", mesh.tets.size()));
    write_elements(ele, mesh.tets.size(), out.progress.part(0.3, 0.9), [&](std::size_t i, Buffer& buffer) {
        const Tetrahedron& t = mesh.tets[i];
        put_line(buffer, i + 1, t[0] + 1, t[1] + 1, t[2] + 1, t[3] + 1, mesh.region(i));
    });
    face.write(fmt::format("{} 1\n", mesh.faces.size()));
    write_elements(face, mesh.faces.size(), out.progress.part(0.9, 1), [&](std::size_t i, Buffer& buffer) {
        const Triangle& t = mesh.faces[i];
        put_line(buffer, i + 1, t[0] + 1, t[1] + 1, t[2] + 1, out.groups.of(mesh.face_regions[i]) + 1);
    });
    for (std::size_t g = 0; g < out.groups.size(); ++g)
        face.write(fmt::format("# marker {}: {}\n", g + 1, out.groups.name(g)));
    // A disk that is full is noticed before any old file is replaced.
    for (AtomicFile* const file : {&node, &ele, &face}) file->flush();
    face.commit();
    node.commit();
    ele.commit();
}

}  // namespace vdbgeo::tet_formats
