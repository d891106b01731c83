// STL: facets with the coordinates of their corners, binary or as text.
#include <Eigen/Geometry>
#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <limits>

#include "converters/mesh_formats.h"
#include "converters/text_cursor.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo::mesh_formats {
namespace {

constexpr std::size_t header_bytes = 80, count_bytes = 4, facet_bytes = 50;
constexpr std::size_t facets_at = header_bytes + count_bytes;

/// Facets to indexed triangles. Corners with the same bits are one vertex; a hash table with open addressing
/// finds it. The facets are looked up in batches whose slots are fetched ahead: the table is far larger than
/// the caches, and waiting for each slot would take most of the time.
class Merger {
 public:
    using Facet = std::array<Vec3f, 3>;

    /// `facets`: how many are expected; more may come.
    Merger(std::string file, std::size_t facets) : file_(std::move(file)) {
        mesh_.triangles.reserve(facets);
        mesh_.points.reserve(facets / 2 + 4);  // a closed surface has about half as many vertices
        while (slots_.size() < facets) slots_.resize(2 * slots_.size(), none);
    }

    void add(const Facet& facet) {
        for (std::size_t k = 0; k < 3; ++k) {
            if (!facet[k].allFinite())
                throw InvalidInput(
                    fmt::format("{}: facet {}: vertex {} has a coordinate that is not a finite number", file_,
                                mesh_.triangles.size() + pending_, k));
            batch_[pending_][k] = facet[k];
            hashes_[pending_][k] = hash(facet[k]);
            __builtin_prefetch(&slots_[hashes_[pending_][k] & (slots_.size() - 1)]);
        }
        if (++pending_ == batch) flush();
    }

    TriMesh finish() {
        flush();
        return std::move(mesh_);
    }

 private:
    static constexpr std::size_t batch = 64;
    static constexpr VertexId none = 0xFFFFFFFF;  // no vertex: TriMesh::max_vertices of them end one below

    static std::array<std::uint32_t, 3> bits(const Vec3f& p) {
        std::array<std::uint32_t, 3> b;
        std::memcpy(b.data(), p.data(), sizeof b);
        return b;
    }
    static std::uint64_t hash(const Vec3f& p) {
        std::uint64_t h = 0;
        for (const std::uint32_t b : bits(p)) {
            h = (h ^ b) * 0x9E3779B97F4A7C15ull;
            h ^= h >> 32;
        }
        return h;
    }

    void flush() {
        for (std::size_t f = 0; f < pending_; ++f) {
            Triangle triangle;
            for (std::size_t k = 0; k < 3; ++k) triangle[k] = find_or_add(batch_[f][k], hashes_[f][k]);
            mesh_.triangles.push_back(triangle);
        }
        pending_ = 0;
    }

    VertexId find_or_add(const Vec3f& p, std::uint64_t h) {
        for (std::size_t s = h & (slots_.size() - 1);; s = (s + 1) & (slots_.size() - 1)) {
            if (slots_[s] == none) return append(p, s);
            if (bits(mesh_.points[slots_[s]]) == bits(p)) return slots_[s];
        }
    }

    VertexId append(const Vec3f& p, std::size_t slot) {
        if (mesh_.points.size() == TriMesh::max_vertices)
            throw InvalidInput(fmt::format("{}: more than 2^32-1 vertices", file_));
        const VertexId id = static_cast<VertexId>(mesh_.points.size());
        mesh_.points.push_back(p);
        slots_[slot] = id;
        if (2 * mesh_.points.size() > slots_.size()) grow();
        return id;
    }

    void grow() {
        slots_.assign(2 * slots_.size(), none);
        for (std::size_t id = 0; id < mesh_.points.size(); ++id) {
            std::size_t s = hash(mesh_.points[id]) & (slots_.size() - 1);
            while (slots_[s] != none) s = (s + 1) & (slots_.size() - 1);
            slots_[s] = static_cast<VertexId>(id);
        }
    }

    std::string file_;
    TriMesh mesh_;
    std::vector<VertexId> slots_ = std::vector<VertexId>(1024, none);
    std::size_t pending_ = 0;
    std::array<Facet, batch> batch_;
    std::array<std::array<std::uint64_t, 3>, batch> hashes_;
};

std::uint32_t declared_facets(std::string_view bytes) {
    return load<std::uint32_t>(bytes.data() + header_bytes, host_is_big_endian);
}

TriMesh read_binary(const MappedFile& file, const Progress& progress) {
    const std::size_t facets = declared_facets(file.bytes());
    Merger merger(file.name(), facets);
    const char* at = file.bytes().data() + facets_at;
    for (std::size_t f = 0; f < facets; ++f, at += facet_bytes) {
        Merger::Facet facet;
        for (std::size_t k = 0; k < 9; ++k)  // after the normal
            facet[k / 3][static_cast<int>(k % 3)] = load<float>(at + 12 + 4 * k, host_is_big_endian);
        merger.add(facet);
        if (f % report_every == 0) progress.report(static_cast<double>(f) / static_cast<double>(facets));
    }
    return merger.finish();
}

std::string lower(std::string_view word) {
    std::string text(word.substr(0, 20));
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

class AsciiReader {
 public:
    explicit AsciiReader(const MappedFile& file)
        : text_(file.bytes(), file.name()), merger_(file.name(), 0) {}

    TriMesh read(const Progress& progress) {
        const double size = static_cast<double>(text_.remaining());
        for (std::size_t n = 1; text_.next_line(); ++n) {
            statement(lower(text_.word()));
            if (n % report_every == 0) progress.report(static_cast<double>(text_.offset()) / size);
        }
        if (in_solid_) text_.fail("the file ends before endsolid");
        return merger_.finish();
    }

 private:
    void statement(const std::string& word) {
        if (word == "vertex") {
            if (!in_facet_ || corners_ == 3) text_.fail("a vertex that is none of a facet's three");
            for (int axis = 0; axis < 3; ++axis) facet_[corners_][axis] = text_.number("coordinate");
            ++corners_;
        } else if (word == "facet") {
            if (!in_solid_ || in_facet_) text_.fail("a facet outside a solid or within a facet");
            in_facet_ = true;
            corners_ = 0;
        } else if (word == "endfacet") {
            if (!in_facet_ || corners_ != 3)
                text_.fail(fmt::format("expected a facet of 3 vertices, found {}", corners_));
            merger_.add(facet_);
            in_facet_ = false;
        } else if (word == "solid" || word == "endsolid") {  // a file may hold several
            if (in_facet_ || in_solid_ == (word == "solid"))
                text_.fail(fmt::format("{} out of place", in_quotes(word)));
            in_solid_ = word == "solid";
        } else if (word != "outer" && word != "endloop") {
            text_.fail(fmt::format("expected a statement of an STL file, found {}", in_quotes(word)));
        }
    }

    TextCursor text_;
    Merger merger_;
    Merger::Facet facet_;
    std::size_t corners_ = 0;
    bool in_solid_ = false, in_facet_ = false;
};

/// Whether a file whose size is not that of a binary one is text: it begins with "solid", and no zero byte is
/// near.
bool looks_like_text(std::string_view bytes) {
    const std::size_t first = std::min(bytes.find_first_not_of(" \t\r\n"), bytes.size());
    return lower(bytes.substr(first, 5)) == "solid" && bytes.substr(0, 512).find('\0') == bytes.npos;
}

Vec3f unit_normal(const TriMesh& mesh, const Triangle& t) {
    const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                c = mesh.points[t[2]].cast<double>();
    const Vec3d normal = (b - a).cross(c - a);
    const double length = normal.stableNorm();
    return length > 0 ? Vec3f((normal / length).cast<float>()) : Vec3f(0, 0, 0);
}

}  // namespace

bool is_binary_stl(std::string_view bytes) {
    return bytes.size() >= facets_at && (bytes.size() - facets_at) % facet_bytes == 0 &&
           (bytes.size() - facets_at) / facet_bytes == declared_facets(bytes);
}

TriMesh read_stl(const MappedFile& file, const Progress& progress) {
    const std::string_view bytes = file.bytes();
    if (is_binary_stl(bytes)) return read_binary(file, progress);
    if (looks_like_text(bytes)) return AsciiReader(file).read(progress);
    if (bytes.size() < facets_at)
        throw InvalidInput(
            fmt::format("{}: no STL file: expected the word solid or {} bytes at least, found {} bytes",
                        file.name(), facets_at, bytes.size()));
    const std::uint64_t facets = declared_facets(bytes);
    throw InvalidInput(fmt::format("{}: byte {}: {} facets take {} bytes, found {}", file.name(),
                                   header_bytes, facets, facets_at + facets * facet_bytes, bytes.size()));
}

void check_stl_facets(std::uint64_t facets, const std::string& name) {
    if (facets > std::numeric_limits<std::uint32_t>::max())
        throw InvalidInput(fmt::format("{}: {} triangles, an STL file holds 2^32-1 at most", name, facets));
}

void write_stl(const TriMesh& mesh, const Output& out) {
    check_stl_facets(mesh.triangles.size(), out.name);
    std::string header = "binary STL by vdbgeo, coordinates in Angstrom";  // must not begin with "solid"
    header.resize(header_bytes, ' ');
    out.file.write(header);
    Buffer count;
    put(count, static_cast<std::uint32_t>(mesh.triangles.size()));
    out.file.write(count.data(), count.size());
    write_elements(out.file, mesh.triangles.size(), out.progress, [&](std::size_t i, Buffer& buffer) {
        const Triangle& t = mesh.triangles[i];
        for (const float c : unit_normal(mesh, t)) put(buffer, c);
        for (const VertexId v : t)
            for (const float c : mesh.points[v]) put(buffer, c);
        put(buffer, std::uint16_t(0));
    });
}

}  // namespace vdbgeo::mesh_formats
