#include "vdbgeo/core/tet_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/tet_adjacency.h"

namespace vdbgeo {
namespace {

constexpr VertexId unused = 0xFFFFFFFFu;
constexpr std::size_t block = 1 << 14;

const MeshProperty* find(const std::vector<MeshProperty>& properties, const std::string& name) {
    for (const MeshProperty& property : properties)
        if (property.name == name) return &property;
    return nullptr;
}

void check_sizes(const std::vector<MeshProperty>& properties, std::size_t elements, const std::string& what) {
    for (const MeshProperty& p : properties) {
        const std::size_t expected = elements * static_cast<std::size_t>(p.components);
        if (p.components < 1 || p.values.size() != expected)
            throw InvalidInput(fmt::format("{}: property '{}' has {} values where {} are needed", what,
                                           p.name, p.values.size(), expected));
    }
}

/// The first element that is not as it should be, or `count`; looked for in parallel.
template <class Good>
std::size_t first_bad(std::size_t count, const Good& good) {
    return fixed_order_reduce(
        count, 1 << 16, count,
        [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                if (!good(i)) return i;
            return count;
        },
        [](std::size_t& all, std::size_t part) { all = std::min(all, part); });
}

template <class Element>
void check_corners(const Array<Element>& elements, std::size_t points, const char* kind,
                   const std::string& what) {
    const auto there = [&](VertexId v) { return v < points; };
    const std::size_t bad = first_bad(elements.size(), [&](std::size_t e) {
        return std::all_of(elements[e].begin(), elements[e].end(), there);
    });
    if (bad == elements.size()) return;
    const VertexId v = *std::find_if_not(elements[bad].begin(), elements[bad].end(), there);
    throw InvalidInput(fmt::format("{}: {} {} names vertex {} of {}", what, kind, bad, v, points));
}

/// Calls body(t, k, inside, outside) for the faces of tetrahedra [begin, end) that are faces of the mesh: on
/// the boundary, or between two regions and told from the one of the smaller number.
template <class Body>
void for_faces(const TetMesh& mesh, const TetAdjacency& adjacency, std::size_t begin, std::size_t end,
               const Body& body) {
    for (std::size_t t = begin; t < end; ++t)
        for (std::size_t k = 0; k < 4; ++k) {
            const std::uint32_t n = adjacency.neighbour[t][k];
            const std::int32_t inside = mesh.region(t);
            const std::int32_t outside = n == TetAdjacency::none ? 0 : mesh.region(n);
            if (outside == 0 || outside > inside) body(t, k, inside, outside);
        }
}

}  // namespace

const MeshProperty* TetMesh::find_vertex_property(const std::string& name) const {
    return find(vertex_properties, name);
}

const MeshProperty* TetMesh::find_tet_property(const std::string& name) const {
    return find(tet_properties, name);
}

void check(const TetMesh& mesh, const std::string& what) {
    if (mesh.points.size() > TriMesh::max_vertices)
        throw InvalidInput(fmt::format("{}: {} vertices, more than 2^32-1", what, mesh.points.size()));
    if (const std::size_t i =
            first_bad(mesh.points.size(), [&](std::size_t v) { return mesh.points[v].allFinite(); });
        i < mesh.points.size())
        throw InvalidInput(
            fmt::format("{}: vertex {} has a coordinate that is not a finite number", what, i));
    check_corners(mesh.tets, mesh.points.size(), "tetrahedron", what);
    check_corners(mesh.faces, mesh.points.size(), "face", what);
    if (!mesh.regions.empty() && mesh.regions.size() != mesh.tets.size())
        throw InvalidInput(
            fmt::format("{}: {} regions for {} tetrahedra", what, mesh.regions.size(), mesh.tets.size()));
    if (const std::size_t t =
            first_bad(mesh.regions.size(), [&](std::size_t i) { return mesh.regions[i] >= 1; });
        t < mesh.regions.size())
        throw InvalidInput(fmt::format("{}: tetrahedron {} is in region {}; regions count from 1", what, t,
                                       mesh.regions[t]));
    if (mesh.face_regions.size() != mesh.faces.size())
        throw InvalidInput(fmt::format("{}: {} pairs of regions for {} faces", what, mesh.face_regions.size(),
                                       mesh.faces.size()));
    check_sizes(mesh.vertex_properties, mesh.points.size(), what);
    check_sizes(mesh.tet_properties, mesh.tets.size(), what);
}

void set_faces(TetMesh& mesh) {
    const TetAdjacency adjacency = tet_adjacency(mesh);
    // Counted in blocks first, so that each block knows where its faces go.
    const std::size_t tets = mesh.tets.size(), blocks = (tets + block - 1) / block;
    std::vector<std::size_t> start(blocks);
    parallel_blocks(tets, block, [&](std::size_t begin, std::size_t end) {
        std::size_t count = 0;
        for_faces(mesh, adjacency, begin, end,
                  [&](std::size_t, std::size_t, std::int32_t, std::int32_t) { ++count; });
        start[begin / block] = count;
    });
    std::size_t sum = 0;
    for (std::size_t& s : start) sum += std::exchange(s, sum);
    mesh.faces.resize(sum);
    mesh.face_regions.resize(sum);
    parallel_blocks(tets, block, [&](std::size_t begin, std::size_t end) {
        std::size_t f = start[begin / block];
        for_faces(mesh, adjacency, begin, end,
                  [&](std::size_t t, std::size_t k, std::int32_t inside, std::int32_t outside) {
                      for (std::size_t c = 0; c < 3; ++c)
                          mesh.faces[f][c] = mesh.tets[t][static_cast<std::size_t>(tet_faces[k][c])];
                      mesh.face_regions[f++] = {inside, outside};
                  });
    });
}

TriMesh boundary_surface(const TetMesh& mesh, std::int32_t region) {
    TriMesh out;
    MeshProperty regions{"region", 1, {}};
    Array<VertexId> number(mesh.points.size());
    std::fill(number.begin(), number.end(), unused);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto [inside, outside] = mesh.face_regions[f];
        if (region == 0 ? outside != 0 : inside != region && outside != region) continue;
        Triangle t = mesh.faces[f];
        if (region != 0 && outside == region) std::swap(t[1], t[2]);
        for (const VertexId v : t) number[v] = 0;
        out.triangles.push_back(t);
        regions.values.push_back(static_cast<float>(region == 0 ? inside : region));
    }
    for (std::size_t v = 0; v < number.size(); ++v) {
        if (number[v] == unused) continue;
        number[v] = static_cast<VertexId>(out.points.size());
        out.points.push_back(mesh.points[v].cast<float>());
    }
    for (Triangle& t : out.triangles)
        for (VertexId& v : t) v = number[v];
    out.face_properties.push_back(std::move(regions));
    return out;
}

}  // namespace vdbgeo
