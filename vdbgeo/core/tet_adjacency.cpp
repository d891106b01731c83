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

/// The two inner corners of a tetrahedron by number. Each is the middle corner of two of its faces: the faces
/// wait for their partners in the bucket of their middle corner, which divides them more evenly than the
/// lowest one, and a bucket needs to hold the tetrahedron only.
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

/// The tetrahedra by their inner corners: those of vertex v end at end[v], where those of v + 1 begin.
/// Threads count and place together; what comes out does not depend on the order within a bucket.
struct Buckets {
    std::vector<std::atomic<std::uint32_t>> end;
    Array<std::uint32_t> tets;

    explicit Buckets(const TetMesh& mesh) : end(mesh.points.size()), tets(2 * mesh.tets.size()) {
        parallel_for(mesh.tets.size(), grain, [&](std::size_t t) {
            const auto [second, third] = inner_corners(mesh.tets[t]);
            end[second].fetch_add(1, std::memory_order_relaxed);
            end[third].fetch_add(1, std::memory_order_relaxed);
        });
        std::uint32_t sum = 0;
        for (auto& e : end) {
            const std::uint32_t count = e.load(std::memory_order_relaxed);
            e.store(sum, std::memory_order_relaxed);
            sum += count;
        }
        parallel_for(mesh.tets.size(), grain, [&](std::size_t t) {
            const auto [second, third] = inner_corners(mesh.tets[t]);
            tets[end[second].fetch_add(1, std::memory_order_relaxed)] = static_cast<std::uint32_t>(t);
            tets[end[third].fetch_add(1, std::memory_order_relaxed)] = static_cast<std::uint32_t>(t);
        });
    }
};

/// Pairs the faces of a bucket in a small hash table.
class Pairing {
 public:
    Pairing(const TetMesh& mesh, TetAdjacency& out) : mesh_(mesh), out_(out) {}

    /// Pairs the faces of the tetrahedra [begin, end) whose middle corner is `vertex`. Returns what is wrong,
    /// or nothing.
    std::string pair(VertexId vertex, const std::uint32_t* begin, const std::uint32_t* end) {
        prepare(2 * static_cast<std::size_t>(end - begin));
        bool good = true;
        for (const std::uint32_t* t = begin; t != end && good; ++t)
            for (std::uint32_t k = 0; k < 4; ++k) {
                const Face f = face_of(mesh_.tets[*t], k);
                if (f.middle == vertex) good = good && meet(f, 4 * *t + k);
            }
        return good ? std::string() : explain(vertex, begin, end);
    }

 private:
    /// Half-faces end at 2^32 − 5, as there are fewer than 2^30 tetrahedra.
    static constexpr std::uint32_t empty = 0xFFFFFFFFu, paired = 0xFFFFFFFEu;
    struct Slot {
        std::uint64_t key;
        std::uint32_t half_face;
        bool even;
    };

    /// An empty table of twice as many places as there are faces, or more.
    void prepare(std::size_t faces) {
        std::size_t size = 16;
        while (size < 2 * faces) size *= 2;
        table_.assign(size, Slot{0, empty, false});
    }

    /// Puts a face down, or pairs it with the one that waits. False where the face cannot be.
    bool meet(const Face& f, std::uint32_t half_face) {
        const std::uint64_t key = std::uint64_t{f.low} << 32 | f.high;
        const std::size_t mask = table_.size() - 1;
        for (std::size_t i = (key * 0x9E3779B97F4A7C15ull) >> 32 & mask;; i = (i + 1) & mask) {
            Slot& slot = table_[i];
            if (slot.half_face == empty) {
                slot = {key, half_face, f.even};
                return true;
            }
            if (slot.key != key) continue;
            if (slot.half_face == paired || slot.even == f.even) return false;
            out_.neighbour[slot.half_face / 4][slot.half_face % 4] = half_face / 4;
            out_.neighbour[half_face / 4][half_face % 4] = slot.half_face / 4;
            slot.half_face = paired;
            return true;
        }
    }

    /// The first fault by number among the faces of a bucket.
    std::string explain(VertexId vertex, const std::uint32_t* begin, const std::uint32_t* end) const {
        std::vector<std::tuple<VertexId, VertexId, bool>> faces;
        for (; begin != end; ++begin)
            for (std::uint32_t k = 0; k < 4; ++k) {
                const Face f = face_of(mesh_.tets[*begin], k);
                if (f.middle == vertex) faces.emplace_back(f.low, f.high, f.even);
            }
        std::sort(faces.begin(), faces.end());
        for (std::size_t i = 0; i + 1 < faces.size(); ++i) {
            const auto& [low, high, even] = faces[i];
            const auto like = [&](std::size_t j) {
                return j < faces.size() && std::get<0>(faces[j]) == low && std::get<1>(faces[j]) == high;
            };
            const bool third = like(i + 1) && like(i + 2);
            if (third || (like(i + 1) && std::get<2>(faces[i + 1]) == even))
                return fmt::format("the triangle of vertices {}, {}, {} has {}", low, vertex, high,
                                   third ? "more than two tetrahedra" : "two tetrahedra on the same side");
        }
        return "the faces of the tetrahedra cannot be paired";  // no way leads here
    }

    const TetMesh& mesh_;
    TetAdjacency& out_;
    std::vector<Slot> table_;
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
                std::string found = pairing.pair(static_cast<VertexId>(v), buckets.tets.data() + at,
                                                 buckets.tets.data() + stop);
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
