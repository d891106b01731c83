#include "vdbgeo/measure/face_bends.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/one_ring.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 13;

/// Finds the faces across the sides that leave a vertex; one object a thread.
class SideFinder {
 public:
    SideFinder(const TriMesh& mesh, Array<std::uint32_t>& across) : mesh_(mesh), across_(across) {}

    void find(const OneRing& ring) {
        outgoing_.clear();
        incoming_.clear();
        for (std::uint32_t k = 0; k < ring.size(); ++k) {
            outgoing_.emplace_back(ring.out(k), k);
            incoming_.emplace_back(ring.in(k), k);
        }
        std::sort(outgoing_.begin(), outgoing_.end());
        std::sort(incoming_.begin(), incoming_.end());
        auto in = incoming_.begin();
        for (auto out = outgoing_.begin(); out != outgoing_.end(); ++out) {
            while (in != incoming_.end() && in->first < out->first) ++in;
            const bool single = (out == outgoing_.begin() || out[-1].first != out->first) &&
                                (out + 1 == outgoing_.end() || out[1].first != out->first) &&
                                in != incoming_.end() && in->first == out->first &&
                                (in + 1 == incoming_.end() || in[1].first != out->first);
            if (!single) continue;
            const std::uint32_t f = ring.face(out->second);
            across_[3 * std::size_t{f} + corner_of(mesh_.triangles[f], ring.vertex())] =
                ring.face(in->second);
        }
    }

 private:
    const TriMesh& mesh_;
    Array<std::uint32_t>& across_;
    std::vector<std::pair<VertexId, std::uint32_t>> outgoing_, incoming_;
};

Vec3d corner(const TriMesh& mesh, std::uint32_t f, std::size_t k) {
    return mesh.points[mesh.triangles[f][k % 3]].cast<double>();
}

Vec3d own_normal(const TriMesh& mesh, std::uint32_t f) {
    const Vec3d a = corner(mesh, f, 0);
    return (corner(mesh, f, 1) - a).cross(corner(mesh, f, 2) - a);
}

/// Not of unit length. A face without area takes its neighbour's: what lies on its sides bends there.
Vec3d normal_of(const TriMesh& mesh, const Array<std::uint32_t>& across, std::uint32_t f) {
    const Vec3d own = own_normal(mesh, f);
    if (own.squaredNorm() > 0) return own;
    std::size_t longest = 0;
    double most = -1;
    for (std::size_t k = 0; k < 3; ++k)
        if (const double length = (corner(mesh, f, k + 1) - corner(mesh, f, k)).squaredNorm();
            length > most) {
            most = length;
            longest = k;
        }
    const std::uint32_t other = across[3 * std::size_t{f} + longest];
    return other == FaceBends::none ? own : own_normal(mesh, other);
}

}  // namespace

FaceBends::FaceBends(const TriMesh& mesh, const VertexFaces& faces)
    : across(3 * mesh.triangles.size()), angle(3 * mesh.triangles.size()) {
    parallel_blocks(mesh.triangles.size(), grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t side = 3 * begin; side < 3 * end; ++side) {
            across[side] = none;
            angle[side] = 0;
        }
    });
    parallel_blocks(mesh.points.size(), grain, [&](std::size_t begin, std::size_t end) {
        OneRing ring(mesh, faces);
        SideFinder sides(mesh, across);
        for (std::size_t v = begin; v < end; ++v) {
            ring.fill(static_cast<VertexId>(v));
            sides.find(ring);
        }
    });
    parallel_for(mesh.triangles.size(), grain, [&](std::size_t face) {
        const auto f = static_cast<std::uint32_t>(face);
        const Vec3d normal = normal_of(mesh, across, f);
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t other = across[3 * face + k];
            if (other == none) continue;
            const Vec3d beyond = normal_of(mesh, across, other);
            const Vec3d edge = corner(mesh, f, k + 1) - corner(mesh, f, k);
            const double length = edge.norm();
            if (!(length > 0)) continue;
            angle[3 * face + k] =
                static_cast<float>(std::atan2(normal.cross(beyond).dot(edge) / length, normal.dot(beyond)));
        }
    });
}

}  // namespace vdbgeo
