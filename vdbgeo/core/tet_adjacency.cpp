#include "vdbgeo/core/tet_adjacency.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <tuple>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = TetAdjacency::none;

/// A face by the two larger of its corners and whether they run up or down seen from outside.
struct Key {
    VertexId middle, high;
    std::uint32_t half_face;  ///< 4 t + k
    bool even;                ///< from low to middle to high is counter-clockwise seen from outside
};

Key key_of(const Tetrahedron& t, std::uint32_t half_face, VertexId& low) {
    const auto& corners = tet_faces[half_face % 4];
    VertexId v[3];
    for (int c = 0; c < 3; ++c) v[c] = t[static_cast<std::size_t>(corners[static_cast<std::size_t>(c)])];
    bool even = true;
    const auto order = [&](int a, int b) {
        if (v[a] > v[b]) std::swap(v[a], v[b]), even = !even;
    };
    order(0, 1), order(1, 2), order(0, 1);
    low = v[0];
    return {v[1], v[2], half_face, even};
}

}  // namespace

TetAdjacency tet_adjacency(const TetMesh& mesh) {
    if (mesh.tets.size() >= (std::size_t{1} << 30))
        throw InvalidInput(fmt::format("{} tetrahedra, more than the 2^30-1 whose faces can be paired",
                                       mesh.tets.size()));
    const std::uint32_t count = static_cast<std::uint32_t>(4 * mesh.tets.size());
    Array<std::uint32_t> start(mesh.points.size() + 1), order(count);
    std::fill(start.begin(), start.end(), 0u);
    const auto low_of = [&](std::uint32_t h) {
        const Tetrahedron& t = mesh.tets[h / 4];
        const auto& c = tet_faces[h % 4];
        return std::min({t[static_cast<std::size_t>(c[0])], t[static_cast<std::size_t>(c[1])],
                         t[static_cast<std::size_t>(c[2])]});
    };
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        Tetrahedron v = mesh.tets[t];
        std::sort(v.begin(), v.end());
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[3])
            throw InvalidInput(fmt::format("tetrahedron {} names vertex {} twice", t,
                                           v[0] == v[1] ? v[0] : v[2] == v[1] ? v[1] : v[2]));
    }
    for (std::uint32_t h = 0; h < count; ++h) ++start[low_of(h) + std::size_t{1}];
    for (std::size_t v = 0; v < mesh.points.size(); ++v) start[v + 1] += start[v];
    for (std::uint32_t h = 0; h < count; ++h) order[start[low_of(h)]++] = h;  // start[v] is now the end of v

    TetAdjacency out;
    out.neighbour.resize(mesh.tets.size());
    parallel_for(mesh.tets.size(), 4096, [&](std::size_t t) { out.neighbour[t].fill(none); });
    parallel_blocks(mesh.points.size(), 4096, [&](std::size_t begin, std::size_t end) {
        std::vector<Key> keys;
        for (std::size_t v = begin; v < end; ++v) {
            keys.clear();
            for (std::uint32_t i = v ? start[v - 1] : 0; i < start[v]; ++i) {
                VertexId low = 0;
                keys.push_back(key_of(mesh.tets[order[i] / 4], order[i], low));
            }
            std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
                return std::tie(a.middle, a.high, a.half_face) < std::tie(b.middle, b.high, b.half_face);
            });
            for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
                const Key &a = keys[i], &b = keys[i + 1];
                if (a.middle != b.middle || a.high != b.high) continue;
                const bool third = i + 2 < keys.size() && keys[i + 2].middle == a.middle && keys[i + 2].high == a.high;
                if (third || a.even == b.even)
                    throw InvalidInput(fmt::format(
                        "the triangle of vertices {}, {}, {} has {}", v, a.middle, a.high,
                        third ? "more than two tetrahedra" : "two tetrahedra on the same side"));
                out.neighbour[a.half_face / 4][a.half_face % 4] = b.half_face / 4;
                out.neighbour[b.half_face / 4][b.half_face % 4] = a.half_face / 4;
                ++i;
            }
        }
    });
    return out;
}

}  // namespace vdbgeo
