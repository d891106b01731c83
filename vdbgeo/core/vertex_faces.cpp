#include "vdbgeo/core/vertex_faces.h"

#include <fmt/format.h>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 13;

}  // namespace

VertexFaces::VertexFaces(const TriMesh& mesh) : end_(mesh.points.size()) {
    const std::size_t count = mesh.triangles.size();
    if (count >= 0xFFFFFFFFull)
        throw InvalidInput(fmt::format("mesh: {} faces, where fewer than 2^32-1 can be numbered", count));
    const auto for_corners = [&](const auto& body) {
        parallel_for(count, grain, [&](std::size_t f) {
            const Triangle& t = mesh.triangles[f];
            if (degenerate(t)) return;
            for (const VertexId v : t) body(v, static_cast<std::uint32_t>(f));
        });
    };
    for_corners([&](VertexId v, std::uint32_t) { end_[v].fetch_add(1, std::memory_order_relaxed); });
    std::uint64_t sum = 0;
    for (auto& end : end_) sum += end.exchange(sum, std::memory_order_relaxed);
    faces_.resize(sum);
    // What counts up from the first place of each vertex ends at the first place of the next one.
    for_corners(
        [&](VertexId v, std::uint32_t f) { faces_[end_[v].fetch_add(1, std::memory_order_relaxed)] = f; });
    parallel_for(end_.size(), grain, [&](std::size_t v) {
        std::uint32_t* first = const_cast<std::uint32_t*>(begin(static_cast<VertexId>(v)));
        std::uint32_t* last = const_cast<std::uint32_t*>(end(static_cast<VertexId>(v)));
        if (!std::is_sorted(first, last)) std::sort(first, last);
    });
}

void VertexStar::fill(const TriMesh& mesh, const VertexFaces& faces, VertexId v) {
    vertex_ = v;
    faces_ = faces.begin(v);
    const auto count = static_cast<std::uint32_t>(faces.end(v) - faces_);
    fan_.resize(count);
    std::iota(fan_.begin(), fan_.end(), 0u);
    spokes_.clear();
    for (std::uint32_t slot = 0; slot < count; ++slot) {
        const Triangle& t = mesh.triangles[faces_[slot]];
        const std::size_t k = corner_of(t, v);
        spokes_.push_back({t[(k + 1) % 3], slot, true});
        spokes_.push_back({t[(k + 2) % 3], slot, false});
    }
    std::sort(spokes_.begin(), spokes_.end(), [](const Spoke& a, const Spoke& b) {
        return a.other != b.other ? a.other < b.other : a.slot < b.slot;
    });
}

}  // namespace vdbgeo
