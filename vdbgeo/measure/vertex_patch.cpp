#include "vdbgeo/measure/vertex_patch.h"

#include <algorithm>
#include <functional>

namespace vdbgeo {

VertexPatch::VertexPatch(const TriMesh& mesh, const VertexNeighbours& neighbours)
    : mesh_(mesh), neighbours_(neighbours) {
    stamp_.assign(mesh.points.size(), 0);
}

void VertexPatch::begin(VertexId v) {
    if (++now_ == 0) {  // after 2^32 patches the old stamps would come up again
        std::fill(stamp_.begin(), stamp_.end(), 0);
        now_ = 1;
    }
    members_.clear();
    members_.push_back({v, 0});
    stamp_[v] = now_;
}

const std::vector<VertexPatch::Member>& VertexPatch::rings(VertexId v, int k) {
    begin(v);
    std::size_t next = 0;
    for (int ring = 1; ring <= k; ++ring)
        for (const std::size_t end = members_.size(); next < end; ++next) {
            const VertexId from = members_[next].vertex;
            for (std::uint64_t e = neighbours_.begin[from]; e < neighbours_.begin[from + 1]; ++e)
                if (const VertexId w = neighbours_.neighbours[e]; mark(w))
                    members_.push_back({w, static_cast<float>(ring)});
        }
    return members_;
}

const std::vector<VertexPatch::Member>& VertexPatch::ball(VertexId v, double radius) {
    begin(v);
    const Vec3d centre = point(v);
    const double square = radius * radius;
    for (std::size_t next = 0; next < members_.size(); ++next) {
        const VertexId from = members_[next].vertex;
        for (std::uint64_t e = neighbours_.begin[from]; e < neighbours_.begin[from + 1]; ++e) {
            const VertexId w = neighbours_.neighbours[e];
            if (!mark(w)) continue;
            const double d = (point(w) - centre).squaredNorm();
            if (d <= square) members_.push_back({w, static_cast<float>(std::sqrt(d))});
        }
    }
    return members_;
}

const std::vector<VertexPatch::Member>& VertexPatch::geodesic(VertexId v, double radius) {
    if (way_.empty()) way_.resize(mesh_.points.size());
    begin(v);
    members_.clear();
    way_[v] = 0;
    heap_.assign(1, {0, v});
    while (!heap_.empty()) {
        std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
        const auto [way, from] = heap_.back();
        heap_.pop_back();
        if (way > way_[from]) continue;  // a shorter way was found since
        members_.push_back({from, static_cast<float>(way)});
        const Vec3d here = point(from);
        for (std::uint64_t e = neighbours_.begin[from]; e < neighbours_.begin[from + 1]; ++e) {
            const VertexId w = neighbours_.neighbours[e];
            const double longer = way + (point(w) - here).norm();
            if (longer > radius || (stamp_[w] == now_ && way_[w] <= longer)) continue;
            stamp_[w] = now_;
            way_[w] = longer;
            heap_.emplace_back(longer, w);
            std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
        }
    }
    return members_;
}

}  // namespace vdbgeo
