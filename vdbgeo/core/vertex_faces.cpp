#include "vdbgeo/core/vertex_faces.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

/// Every thread reads all faces; more than this many would only wait for memory.
constexpr std::size_t most_ranges = 8;
/// Vertices below which a second thread does not pay.
constexpr std::size_t smallest_range = 1 << 14;

/// Calls body(vertex, face) for the corners, in order of the faces, whose vertex is in [begin, end).
template <class Body>
void for_corners(const TriMesh& mesh, std::size_t begin, std::size_t end, const Body& body) {
    const std::size_t length = end - begin;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
        const Triangle& t = mesh.triangles[f];
        if (degenerate(t)) continue;
        for (const VertexId v : t)
            if (v - begin < length) body(v, static_cast<std::uint32_t>(f));
    }
}

}  // namespace

VertexFaces::VertexFaces(const TriMesh& mesh) : end_(mesh.points.size()) {
    if (mesh.triangles.size() >= 0xFFFFFFFFull)
        throw InvalidInput(
            fmt::format("mesh: {} faces, where fewer than 2^32-1 can be numbered", mesh.triangles.size()));
    // Each thread has its own range of vertices: nothing is shared, and the faces come in order by
    // themselves.
    const std::size_t threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    const std::size_t ranges =
        std::clamp<std::size_t>(end_.size() / smallest_range, 1, std::min(threads, most_ranges));
    const std::size_t range = std::max<std::size_t>(1, (end_.size() + ranges - 1) / ranges);
    parallel_blocks(end_.size(), range, [&](std::size_t begin, std::size_t end) {
        std::fill(end_.begin() + static_cast<std::ptrdiff_t>(begin),
                  end_.begin() + static_cast<std::ptrdiff_t>(end), std::uint64_t{0});
        for_corners(mesh, begin, end, [&](VertexId v, std::uint32_t) { ++end_[v]; });
    });
    std::uint64_t sum = 0;
    for (std::uint64_t& end : end_) sum += std::exchange(end, sum);
    faces_.resize(sum);
    // What counts up from the first place of each vertex ends at the first place of the next one.
    parallel_blocks(end_.size(), range, [&](std::size_t begin, std::size_t end) {
        for_corners(mesh, begin, end, [&](VertexId v, std::uint32_t f) { faces_[end_[v]++] = f; });
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
