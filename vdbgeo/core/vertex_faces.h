// Which faces meet at each vertex of a mesh, and how they hang together there.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Whether a face names a vertex twice: it has no area, and its sides are no edges.
inline bool degenerate(const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

/// The corner (0…2) at which a face has `v`.
inline std::size_t corner_of(const Triangle& t, VertexId v) { return t[0] == v ? 0 : t[1] == v ? 1 : 2; }

/// The faces at each vertex in rising order, degenerate ones left out. 12 bytes a face and 8 a vertex; the
/// same for any number of threads. Throws InvalidInput for 2^32 faces or more.
class VertexFaces {
 public:
    explicit VertexFaces(const TriMesh& mesh);

    std::size_t vertices() const { return end_.size(); }
    const std::uint32_t* begin(VertexId v) const { return faces_.data() + (v == 0 ? 0 : end_[v - 1]); }
    const std::uint32_t* end(VertexId v) const { return faces_.data() + end_[v]; }

 private:
    Array<std::uint64_t> end_;  // of each vertex's faces
    Array<std::uint32_t> faces_;
};

/// The sides of the faces at one vertex v, edge by edge. Made once and filled for vertex after vertex.
class VertexStar {
 public:
    /// A side of a face that begins (out) or ends at v.
    struct Spoke {
        VertexId other;      ///< the edge's other end
        std::uint32_t slot;  ///< the face's place among those of v
        bool out;            ///< the face runs from v to `other`
    };

    void fill(const TriMesh& mesh, const VertexFaces& faces, VertexId v);

    std::size_t face_count() const { return fan_.size(); }
    std::uint32_t face(std::uint32_t slot) const { return faces_[slot]; }
    std::uint32_t slot_of(std::uint32_t face) const {
        return static_cast<std::uint32_t>(std::lower_bound(faces_, faces_ + fan_.size(), face) - faces_);
    }
    VertexId vertex() const { return vertex_; }

    /// Calls visit(first, last) for the spokes of each edge; the edges by their other end, the spokes by
    /// face.
    template <class Visit>
    void for_each_edge(const Visit& visit) const {
        for (const Spoke *first = spokes_.data(), *all = first + spokes_.size(), *last; first != all;
             first = last) {
            for (last = first + 1; last != all && last->other == first->other; ++last) {
            }
            visit(first, last);
        }
    }

    /// Puts two faces into one fan. After fill every face is a fan of its own.
    void join(std::uint32_t a, std::uint32_t b) {
        a = fan(a);
        b = fan(b);
        fan_[std::max(a, b)] = std::min(a, b);
    }
    /// The lowest slot of the fan that a face belongs to.
    std::uint32_t fan(std::uint32_t slot) {
        while (fan_[slot] != slot) slot = fan_[slot] = fan_[fan_[slot]];
        return slot;
    }
    std::size_t fan_count() {
        std::size_t count = 0;
        for (std::uint32_t s = 0; s < fan_.size(); ++s) count += fan_[s] == s;
        return count;
    }

 private:
    VertexId vertex_ = 0;
    const std::uint32_t* faces_ = nullptr;
    std::vector<Spoke> spokes_;
    std::vector<std::uint32_t> fan_;
};

}  // namespace vdbgeo
