#include "vdbgeo/tet/void_sides.h"

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/disjoint_sets.h"

namespace vdbgeo {
namespace {

struct EdgeUse {
    VertexId low, high;
    std::uint32_t face;
    VertexId apex;
    bool rising;  ///< the face runs from low to high

    bool same_edge(const EdgeUse& o) const { return low == o.low && high == o.high; }
};

std::vector<EdgeUse> edge_uses(const TriMesh& mesh) {
    std::vector<EdgeUse> uses;
    uses.reserve(3 * mesh.triangles.size());
    for (std::uint32_t f = 0; f < mesh.triangles.size(); ++f)
        for (std::size_t k = 0; k < 3; ++k) {
            const Triangle& t = mesh.triangles[f];
            const VertexId a = t[k], b = t[(k + 1) % 3];
            uses.push_back({std::min(a, b), std::max(a, b), f, t[(k + 2) % 3], a < b});
        }
    std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
        if (a.low != b.low) return a.low < b.low;
        return a.high != b.high ? a.high < b.high : a.face < b.face;
    });
    return uses;
}

/// Puts the faces around an edge into the order in which they are met turning about it, right-handed from low
/// to high. A rising face then looks at the next one, a falling face at the one before.
void sort_around(const TriMesh& mesh, EdgeUse* begin, EdgeUse* end) {
    const Vec3d origin = mesh.points[begin->low].cast<double>();
    const Vec3d axis = (mesh.points[begin->high].cast<double>() - origin).normalized();
    const Vec3d u = axis.unitOrthogonal(), v = axis.cross(u);
    const auto angle = [&](const EdgeUse& use) {
        const Vec3d d = mesh.points[use.apex].cast<double>() - origin;
        return std::atan2(d.dot(v), d.dot(u));
    };
    std::sort(begin, end, [&](const EdgeUse& a, const EdgeUse& b) {
        const double at = angle(a), bt = angle(b);
        return at != bt ? at < bt : a.face < b.face;
    });
}

}  // namespace

std::vector<std::vector<std::uint32_t>> void_sides(const TriMesh& mesh,
                                                   const std::vector<bool>& empty_before) {
    DisjointSets sets(mesh.triangles.size());
    std::vector<EdgeUse> uses = edge_uses(mesh);
    for (std::size_t begin = 0, end; begin < uses.size(); begin = end) {
        for (end = begin; end < uses.size() && uses[end].same_edge(uses[begin]);) ++end;
        const std::size_t n = end - begin;
        if (n > 2) sort_around(mesh, uses.data() + begin, uses.data() + end);
        for (std::size_t i = 0; i < n; ++i) {
            const EdgeUse &a = uses[begin + i], &b = uses[begin + (i + 1) % n];
            const bool facing = n == 2 || (a.rising && !b.rising);
            if (facing && empty_before[a.face] && empty_before[b.face]) sets.join(a.face, b.face);
        }
    }
    constexpr std::uint32_t none = 0xFFFFFFFFu;
    std::vector<std::uint32_t> part_of(mesh.triangles.size(), none);
    std::vector<std::vector<std::uint32_t>> parts;
    for (std::uint32_t f = 0; f < mesh.triangles.size(); ++f) {
        if (!empty_before[f]) continue;
        std::uint32_t& part = part_of[sets.find(f)];
        if (part == none) {
            part = static_cast<std::uint32_t>(parts.size());
            parts.emplace_back();
        }
        parts[part].push_back(f);
    }
    return parts;
}

}  // namespace vdbgeo
