#include "vdbgeo/core/tet_adjacency.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t none = TetAdjacency::none;
constexpr std::size_t grain = 4096;

/// The corners of a face by number, and which way round they are.
struct Face {
    VertexId low, middle, high;
    bool even;  ///< from low to middle to high is counter-clockwise seen from outside
};

Face face_of(const Tetrahedron& t, std::uint32_t k) {
    const auto& corners = tet_faces[k];
    VertexId v[3];
    for (std::size_t c = 0; c < 3; ++c) v[c] = t[static_cast<std::size_t>(corners[c])];
    bool even = true;
    const auto order = [&](int a, int b) {
        if (v[a] > v[b]) std::swap(v[a], v[b]), even = !even;
    };
    order(0, 1), order(1, 2), order(0, 1);
    return {v[0], v[1], v[2], even};
}

/// The faces of a tetrahedron wait for their partners in the bucket of their middle corner (which divides
/// them more evenly than the lowest), as numbers that sort by the other two corners, or nearly so: the upper
/// half mixes both, the lower is the half-face 4 t + k. What mixes to the same and is not is told apart
/// later.
struct Bucketed {
    VertexId bucket;
    std::uint64_t entry;
};

Bucketed bucketed(const Tetrahedron& t, std::uint32_t tet, std::uint32_t k) {
    const Face f = face_of(t, k);
    const std::uint32_t mixed = f.low * 0x9E3779B1u + f.high;
    return {f.middle, std::uint64_t{mixed} << 32 | (4 * tet + k)};
}

std::uint32_t mixed_of(std::uint64_t entry) { return static_cast<std::uint32_t>(entry >> 32); }
std::uint32_t half_face_of(std::uint64_t entry) { return static_cast<std::uint32_t>(entry); }

/// The two corners by which the faces of a tetrahedron are in buckets: the second and third by number, each
/// for two faces.
std::pair<VertexId, VertexId> inner_corners(const Tetrahedron& t) {
    const auto [a, b] = std::minmax(t[0], t[1]);
    const auto [c, d] = std::minmax(t[2], t[3]);
    return std::minmax(std::max(a, c), std::min(b, d));
}

void refuse_repeated_vertices(const TetMesh& mesh) {
    constexpr std::size_t fine = std::numeric_limits<std::size_t>::max();
    const std::size_t first = fixed_order_reduce(
        mesh.tets.size(), 1 << 16, fine,
        [&](std::size_t begin, std::size_t end) {
            for (std::size_t t = begin; t < end; ++t) {
                const auto& [a, b, c, d] = mesh.tets[t];
                if (a == b || a == c || a == d || b == c || b == d || c == d) return t;
            }
            return fine;
        },
        [](std::size_t& all, std::size_t part) { all = std::min(all, part); });
    if (first == fine) return;
    Tetrahedron v = mesh.tets[first];
    std::sort(v.begin(), v.end());
    throw InvalidInput(
        fmt::format("tetrahedron {} names vertex {} twice", first, *std::adjacent_find(v.begin(), v.end())));
}

/// All half-faces by their buckets: those of vertex v end at end[v], where those of v + 1 begin. Threads
/// count and place together: the order within a bucket is any, and is sorted away.
struct Buckets {
    std::vector<std::atomic<std::uint32_t>> end;
    Array<std::uint64_t> entries;

    explicit Buckets(const TetMesh& mesh) : end(mesh.points.size()) {
        parallel_for(mesh.tets.size(), grain, [&](std::size_t t) {
            const auto [second, third] = inner_corners(mesh.tets[t]);
            end[second].fetch_add(2, std::memory_order_relaxed);
            end[third].fetch_add(2, std::memory_order_relaxed);
        });
        std::uint32_t sum = 0;
        for (auto& e : end) {
            const std::uint32_t count = e.load(std::memory_order_relaxed);
            e.store(sum, std::memory_order_relaxed);
            sum += count;
        }
        entries.resize(sum);
        parallel_for(mesh.tets.size(), grain, [&](std::size_t t) {
            for (std::uint32_t k = 0; k < 4; ++k) {
                const Bucketed b = bucketed(mesh.tets[t], static_cast<std::uint32_t>(t), k);
                entries[end[b.bucket].fetch_add(1, std::memory_order_relaxed)] = b.entry;
            }
        });
    }
};

/// Pairs the faces of a bucket.
class Pairing {
 public:
    Pairing(const TetMesh& mesh, TetAdjacency& out) : mesh_(mesh), out_(out) {}

    /// Sorts [begin, end) and pairs what is equal. Returns what is wrong, or nothing.
    std::string pair(std::uint64_t* begin, std::uint64_t* end) {
        std::sort(begin, end);
        while (begin != end) {
            std::uint64_t* stop = begin + 1;
            while (stop != end && mixed_of(*stop) == mixed_of(*begin)) ++stop;
            if (stop - begin > 1) {
                std::string wrong = pair_alike(begin, stop);
                if (!wrong.empty()) return wrong;
            }
            begin = stop;
        }
        return {};
    }

 private:
    struct Keyed {
        Face face;
        std::uint32_t half_face;
        auto key() const { return std::tie(face.low, face.high); }
    };

    std::string pair_alike(const std::uint64_t* begin, const std::uint64_t* end) {
        faces_.clear();
        for (; begin != end; ++begin) {
            const std::uint32_t h = half_face_of(*begin);
            faces_.push_back({face_of(mesh_.tets[h / 4], h % 4), h});
        }
        if (faces_.size() > 2)
            std::sort(faces_.begin(), faces_.end(), [](const Keyed& a, const Keyed& b) {
                return std::tie(a.face.low, a.face.high, a.half_face) <
                       std::tie(b.face.low, b.face.high, b.half_face);
            });
        for (std::size_t i = 0; i + 1 < faces_.size(); ++i) {
            const Keyed &a = faces_[i], &b = faces_[i + 1];
            if (a.key() != b.key()) continue;
            const bool third = i + 2 < faces_.size() && faces_[i + 2].key() == a.key();
            if (third || a.face.even == b.face.even)
                return fmt::format("the triangle of vertices {}, {}, {} has {}", a.face.low, a.face.middle,
                                   a.face.high,
                                   third ? "more than two tetrahedra" : "two tetrahedra on the same side");
            out_.neighbour[a.half_face / 4][a.half_face % 4] = b.half_face / 4;
            out_.neighbour[b.half_face / 4][b.half_face % 4] = a.half_face / 4;
            ++i;
        }
        return {};
    }

    const TetMesh& mesh_;
    TetAdjacency& out_;
    std::vector<Keyed> faces_;
};

}  // namespace

TetAdjacency tet_adjacency(const TetMesh& mesh) {
    if (mesh.tets.size() >= (std::size_t{1} << 30))
        throw InvalidInput(
            fmt::format("{} tetrahedra, more than the 2^30-1 whose faces can be paired", mesh.tets.size()));
    refuse_repeated_vertices(mesh);
    Buckets buckets(mesh);
    TetAdjacency out;
    out.neighbour.resize(mesh.tets.size());
    parallel_for(mesh.tets.size(), grain, [&](std::size_t t) { out.neighbour[t].fill(none); });
    // What is wrong is told of the first bucket in order that has something wrong, whoever finds it first.
    const std::string wrong = fixed_order_reduce(
        buckets.end.size(), grain, std::string(),
        [&](std::size_t begin, std::size_t end) {
            Pairing pairing(mesh, out);
            std::uint32_t at = begin == 0 ? 0 : buckets.end[begin - 1].load(std::memory_order_relaxed);
            for (std::size_t v = begin; v < end; ++v) {
                const std::uint32_t stop = buckets.end[v].load(std::memory_order_relaxed);
                std::string found = pairing.pair(buckets.entries.data() + at, buckets.entries.data() + stop);
                if (!found.empty()) return found;
                at = stop;
            }
            return std::string();
        },
        [](std::string& all, const std::string& part) {
            if (all.empty()) all = part;
        });
    if (!wrong.empty()) throw InvalidInput(wrong);
    return out;
}

}  // namespace vdbgeo
