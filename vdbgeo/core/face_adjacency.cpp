#include "vdbgeo/core/face_adjacency.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = FaceAdjacency::none;

struct Pairing {
    const TriMesh& mesh;
    FaceAdjacency& out;
    std::vector<bool> bad;  ///< faces that no half-edge mesh can hold

    VertexId from(std::uint32_t h) const { return mesh.triangles[h / 3][h % 3]; }
    VertexId to(std::uint32_t h) const { return mesh.triangles[h / 3][(h + 1) % 3]; }

    /// Half-edges by the lower of their vertices, in order.
    void pair_edges() {
        const std::uint32_t count = static_cast<std::uint32_t>(3 * mesh.triangles.size());
        Array<std::uint32_t> start(mesh.points.size() + 1), order(count);
        std::fill(start.begin(), start.end(), 0u);
        for (std::uint32_t h = 0; h < count; ++h) ++start[std::min(from(h), to(h)) + std::size_t{1}];
        for (std::size_t v = 0; v < mesh.points.size(); ++v) start[v + 1] += start[v];
        for (std::uint32_t h = 0; h < count; ++h) order[start[std::min(from(h), to(h))]++] = h;
        for (std::size_t v = 0; v < mesh.points.size(); ++v)
            pair_bucket(order.data() + (v ? start[v - 1] : 0), order.data() + start[v]);
    }
    void pair_bucket(std::uint32_t* begin, std::uint32_t* end) {
        const auto high = [&](std::uint32_t h) { return std::max(from(h), to(h)); };
        // Few at most vertices; a vertex with a thousand faces must not cost a million comparisons.
        if (end - begin > 16)
            std::sort(begin, end,
                      [&](auto a, auto b) { return std::pair(high(a), a) < std::pair(high(b), b); });
        else
            for (auto i = begin; i < end; ++i)  // insertion by vertex keeps the order among equals
                for (auto j = i; j > begin && high(j[-1]) > high(*j); --j) std::swap(j[-1], *j);
        for (auto i = begin; i < end;) {
            auto j = i + 1;
            while (j < end && high(*j) == high(*i)) ++j;
            if (j - i == 2 && from(i[0]) == to(i[1])) {
                out.twin[i[0]] = i[1];
                out.twin[i[1]] = i[0];
            } else if (j - i > 1) {
                for (auto k = i; k < j; ++k) bad[*k / 3] = true;
            }
            i = j;
        }
    }
    void find_fans() {
        std::vector<std::uint32_t> corners(mesh.points.size(), 0);
        for (std::uint32_t h = 0; h < out.twin.size(); ++h) {
            const VertexId v = from(h);
            ++corners[v];
            if (out.outgoing[v] == none || (out.twin[h] == none && out.twin[out.outgoing[v]] != none))
                out.outgoing[v] = h;
        }
        std::vector<bool> split(mesh.points.size(), false);
        bool any = false;
        for (std::size_t v = 0; v < mesh.points.size(); ++v) {
            std::uint32_t h = out.outgoing[v], met = 0;
            if (h == none) continue;
            do ++met, h = out.around(h);
            while (h != none && h != out.outgoing[v] && met <= corners[v]);
            if (met != corners[v]) any = split[v] = true;
        }
        if (any)
            for (std::size_t h = 0; h < out.twin.size(); ++h)
                if (split[from(static_cast<std::uint32_t>(h))]) bad[h / 3] = true;
    }
};

}  // namespace

FaceAdjacency face_adjacency(const TriMesh& mesh, const char* stage) {
    if (mesh.triangles.size() > 0x7FFFFFFFull / 3)
        throw InvalidInput(fmt::format("{}: {} faces, more than the {} that half-edges can count", stage,
                                       mesh.triangles.size(), 0x7FFFFFFFull / 3));
    FaceAdjacency out;
    out.twin.resize(3 * mesh.triangles.size());
    std::fill(out.twin.begin(), out.twin.end(), none);
    out.outgoing.resize(mesh.points.size());
    std::fill(out.outgoing.begin(), out.outgoing.end(), none);
    Pairing pairing{mesh, out, std::vector<bool>(mesh.triangles.size(), false)};
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) pairing.bad[f] = true;
    }
    pairing.pair_edges();
    if (std::find(pairing.bad.begin(), pairing.bad.end(), true) == pairing.bad.end()) pairing.find_fans();
    if (const auto bad = std::count(pairing.bad.begin(), pairing.bad.end(), true))
        throw InvalidInput(
            fmt::format("{} needs a manifold mesh: {} faces cannot be added; try repair", stage, bad));
    return out;
}

}  // namespace vdbgeo
