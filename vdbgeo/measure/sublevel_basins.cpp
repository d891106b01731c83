#include "vdbgeo/measure/sublevel_basins.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <numeric>

#include "vdbgeo/core/disjoint_sets.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = 0xFFFFFFFFu;

/// Who is joined to whom among some vertices, by their places; most neighbours come twice.
struct Links {
    std::vector<std::uint64_t> end;
    std::vector<std::uint32_t> to;

    Links(const TriMesh& mesh, const std::vector<VertexId>& vertices) : end(vertices.size() + 1, 0) {
        Array<std::uint32_t> place;
        place.assign(mesh.points.size(), none);
        for (std::size_t i = 0; i < vertices.size(); ++i) place[vertices[i]] = static_cast<std::uint32_t>(i);
        const MeshProperty* caps = mesh.find_face_property(cap_property);
        if (caps && caps->components != 1) caps = nullptr;
        const auto for_each = [&](const auto& visit) {
            for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
                const Triangle& t = mesh.triangles[f];
                const std::array<std::uint32_t, 3> at = {place[t[0]], place[t[1]], place[t[2]]};
                if ((at[0] == none) + (at[1] == none) + (at[2] == none) > 1) continue;
                if (caps && caps->values[f] > 0.5f) continue;
                for (std::size_t k = 0; k < 3; ++k) {
                    const std::uint32_t a = at[k], b = at[(k + 1) % 3];
                    if (a != none && b != none && a != b) visit(a, b), visit(b, a);
                }
            }
        };
        for_each([&](std::uint32_t a, std::uint32_t) { ++end[a + std::size_t{1}]; });
        std::partial_sum(end.begin(), end.end(), end.begin());
        to.resize(end.back());
        std::vector<std::uint64_t> next(end.begin(), end.end() - 1);
        for_each([&](std::uint32_t a, std::uint32_t b) { to[next[a]++] = b; });
    }
    const std::uint32_t* begin_of(std::uint32_t i) const { return to.data() + end[i]; }
    const std::uint32_t* end_of(std::uint32_t i) const { return to.data() + end[i + std::size_t{1}]; }
};

}  // namespace

std::vector<std::uint32_t> sublevel_basins(const TriMesh& mesh, const std::vector<VertexId>& vertices,
                                           const std::vector<double>& values, double min_persistence) {
    const Links links(mesh, vertices);
    const auto lower = [&](std::uint32_t a, std::uint32_t b) {
        return values[a] != values[b] ? values[a] < values[b] : a < b;
    };
    std::vector<std::uint32_t> order(vertices.size()), basin(vertices.size(), none);
    std::iota(order.begin(), order.end(), 0u);
    tbb::parallel_sort(order.begin(), order.end(), lower);
    // Basins are numbered as they open, the deepest first: the lowest number of a set is its deepest.
    DisjointSets sets(vertices.size());
    std::vector<double> least;
    std::vector<std::uint32_t> met;
    for (const std::uint32_t i : order) {
        met.clear();
        std::uint32_t lowest = none;
        for (const std::uint32_t* n = links.begin_of(i); n != links.end_of(i); ++n) {
            if (basin[*n] == none) continue;
            if (lowest == none || lower(*n, lowest)) lowest = *n;
            met.push_back(sets.find(basin[*n]));
        }
        if (lowest == none) {
            basin[i] = static_cast<std::uint32_t>(least.size());
            least.push_back(values[i]);
            continue;
        }
        const std::uint32_t deepest = *std::min_element(met.begin(), met.end());
        for (const std::uint32_t b : met)
            if (b != deepest && values[i] - least[b] < min_persistence) sets.join(b, deepest);
        basin[i] = basin[lowest];
    }
    std::vector<std::uint32_t> number(least.size(), none);
    std::uint32_t count = 0;
    for (std::uint32_t& b : basin) {
        std::uint32_t& n = number[sets.find(b)];
        if (n == none) n = count++;
        b = n;
    }
    return basin;
}

}  // namespace vdbgeo
