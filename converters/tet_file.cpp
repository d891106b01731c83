#include "converters/tet_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>

#include "converters/tet_formats.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using namespace tet_formats;

struct Format {
    const char* ending;
    TetSoup (*read)(const std::filesystem::path&, const Progress&);
    void (*write)(const TetOutput&);
};

constexpr Format formats[] = {{".vtu", read_vtu, write_vtu},
                              {".mesh", read_medit, write_medit},
                              {".msh", read_gmsh, write_gmsh},
                              {".node", read_tetgen, write_tetgen},
                              {".ele", read_tetgen, write_tetgen}};

/// The format that the name tells, nullptr for none.
const Format* format_of(const std::filesystem::path& path) {
    std::string ending = path.extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    for (const Format& format : formats)
        if (ending == format.ending) return &format;
    return nullptr;
}

const Format& known_format(const std::filesystem::path& path) {
    if (const Format* const format = format_of(path)) return *format;
    throw InvalidInput(fmt::format("{}: not the name of a file of tetrahedra: expected an ending among {}",
                                   path.string(), fmt::join(tet_endings(), ", ")));
}

/// Takes away the points that are within edges of quadratic tetrahedra and corners of none.
void drop_middles(TetSoup& soup) {
    if (soup.middles.empty()) return;
    Array<std::uint8_t>& drop = soup.middles;
    drop.resize(soup.points.size(), 0);
    for (const Tetrahedron& t : soup.tets)
        for (const VertexId v : t) drop[v] = 0;
    Array<VertexId> number(soup.points.size());
    std::size_t kept = 0;
    for (std::size_t v = 0; v < number.size(); ++v) {
        number[v] = static_cast<VertexId>(kept);
        if (drop[v]) continue;
        soup.points[kept] = soup.points[v];
        for (MeshProperty& p : soup.vertex_properties) {
            const std::size_t n = static_cast<std::size_t>(p.components);
            std::copy_n(&p.values[v * n], n, &p.values[kept * n]);
        }
        ++kept;
    }
    soup.points.resize(kept);
    for (MeshProperty& p : soup.vertex_properties)
        p.values.resize(kept * static_cast<std::size_t>(p.components));
    for (Tetrahedron& t : soup.tets)
        for (VertexId& v : t) v = number[v];
}

/// Numbers of regions from labels: whole numbers from 1 stay, the others get the next free ones, the least
/// label first.
Array<std::int32_t> regions_of(const Array<double>& labels, const std::string& name) {
    constexpr double most = std::numeric_limits<std::int32_t>::max();
    const auto stays = [&](double l) { return l >= 1 && l <= most && l == std::floor(l); };
    Array<double> others;
    double largest = 0;
    for (std::size_t t = 0; t < labels.size(); ++t) {
        if (std::isnan(labels[t]))
            throw InvalidInput(fmt::format("{}: tetrahedron {}: its region is not a number", name, t));
        if (stays(labels[t]))
            largest = std::max(largest, labels[t]);
        else if (others.empty() || others.back() != labels[t])
            others.push_back(labels[t]);
    }
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    if (!others.empty() && largest + static_cast<double>(others.size()) > most)
        throw InvalidInput(fmt::format("{}: no numbers are left for regions that are not 1 to 2^31-1", name));
    Array<std::int32_t> regions(labels.size());
    bool plain = true;  // all are region 1
    for (std::size_t t = 0; t < labels.size(); ++t) {
        double region = labels[t];
        if (!stays(region))
            region =
                largest + 1 +
                static_cast<double>(std::lower_bound(others.begin(), others.end(), region) - others.begin());
        regions[t] = static_cast<std::int32_t>(region);
        plain = plain && regions[t] == 1;
    }
    return plain ? Array<std::int32_t>() : regions;
}

/// Turns all tetrahedra over where none of them is turned as it should be.
void orient(TetMesh& mesh) {
    bool negative = false;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const double volume = tet_determinant(mesh, t);
        if (volume > 0) return;
        negative = negative || volume < 0;
    }
    if (negative)
        for (Tetrahedron& t : mesh.tets) std::swap(t[2], t[3]);
}

TetMesh mesh_of(TetSoup soup, const std::string& name) {
    if (soup.tets.empty() && soup.surfaces > 0)
        throw InvalidInput(fmt::format("{}: a surface of {} faces, no tetrahedra", name, soup.surfaces));
    drop_middles(soup);
    TetMesh mesh;
    mesh.points = std::move(soup.points);
    mesh.tets = std::move(soup.tets);
    mesh.vertex_properties = std::move(soup.vertex_properties);
    mesh.tet_properties = std::move(soup.tet_properties);
    mesh.regions = regions_of(soup.labels, name);
    check(mesh, name);
    orient(mesh);
    try {
        set_faces(mesh);
    } catch (const InvalidInput& error) {
        throw InvalidInput(fmt::format("{}: {}", name, error.what()));
    }
    return mesh;
}

}  // namespace

namespace tet_formats {

FaceGroups::FaceGroups(const TetMesh& mesh) {
    for (const auto& pair : mesh.face_regions)
        if (pairs_.empty() || pairs_.back() != pair) pairs_.push_back(pair);
    std::sort(pairs_.begin(), pairs_.end());
    pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
}

std::size_t FaceGroups::of(const std::array<std::int32_t, 2>& pair) const {
    return static_cast<std::size_t>(std::lower_bound(pairs_.begin(), pairs_.end(), pair) - pairs_.begin());
}

std::string FaceGroups::name(std::size_t g) const {
    const auto [inside, outside] = pairs_[g];
    return outside == 0 ? fmt::format("boundary_{}", inside)
                        : fmt::format("interface_{}_{}", inside, outside);
}

}  // namespace tet_formats

void write_tets(const TetMesh& mesh, const std::filesystem::path& path, const Progress& progress) {
    const Format& format = known_format(path);
    check(mesh, path.string());
    if (!mesh.faces.empty() || mesh.tets.empty()) {
        format.write({mesh, FaceGroups(mesh), path, progress});
    } else {  // faces were not asked for yet
        TetMesh whole{mesh.points,        mesh.tets, mesh.regions, {}, {}, mesh.vertex_properties,
                      mesh.tet_properties};
        set_faces(whole);
        format.write({whole, FaceGroups(whole), path, progress});
    }
    progress.report(1);
}

TetMesh read_tets(const std::filesystem::path& path, const Progress& progress) {
    const Format& format = known_format(path);
    TetMesh mesh = mesh_of(format.read(path, progress.part(0, 0.7)), path.string());
    progress.report(1);
    return mesh;
}

std::vector<std::string> tet_endings() {
    std::vector<std::string> endings;
    for (const Format& format : formats) endings.emplace_back(format.ending);
    return endings;
}

std::string tet_endings_text() { return fmt::format("{}", fmt::join(tet_endings(), " ")); }

bool is_tet_ending(const std::filesystem::path& path) { return format_of(path) != nullptr; }

bool holds_tets(const std::filesystem::path& path) {
    const Format* const format = format_of(path);
    return format && (format->read != read_vtu || vtu_holds_tets(path));
}

}  // namespace vdbgeo
