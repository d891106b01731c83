// Faces that know their neighbours: connectivity for edge collapses in 24 bytes a face.
#pragma once

#include <cstdint>
#include <string>

#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Triangles with, for each corner, the corner that looks at the same edge from the other side. Corner i of
/// face f has the number 4f + i.
class CornerTable {
 public:
    using Corner = std::uint32_t;
    static constexpr std::uint32_t none = 0xFFFFFFFFu;
    static constexpr std::uint64_t max_faces = 1u << 30;

    struct Face {
        VertexId vertices[3];  ///< [0] is `none` on faces that are gone
        Corner opposite[3];    ///< `none` across a border
    };

    /// Throws InvalidInput "STAGE needs a manifold mesh: …; try repair" for a repeated corner, an edge of
    /// over two faces or of two that run along it in the same direction, and a vertex with several fans of
    /// faces.
    CornerTable(const TriMesh& mesh, const std::string& stage);

    static Corner next(Corner c) { return (c & ~3u) | ((9u >> (2 * (c & 3u))) & 3u); }
    static Corner previous(Corner c) { return (c & ~3u) | ((18u >> (2 * (c & 3u))) & 3u); }
    static std::uint32_t face_of(Corner c) { return c >> 2; }

    VertexId& vertex(Corner c) { return faces_[c >> 2].vertices[c & 3u]; }
    VertexId vertex(Corner c) const { return faces_[c >> 2].vertices[c & 3u]; }
    Corner& opposite(Corner c) { return faces_[c >> 2].opposite[c & 3u]; }
    Corner opposite(Corner c) const { return faces_[c >> 2].opposite[c & 3u]; }

    /// The same vertex's corner in the next face around it, counter-clockwise or clockwise; `none` at a
    /// border.
    Corner left(Corner c) const {
        const Corner o = opposite(next(c));
        return o == none ? none : next(o);
    }
    Corner right(Corner c) const {
        const Corner o = opposite(previous(c));
        return o == none ? none : previous(o);
    }

    void prefetch(Corner c) const { __builtin_prefetch(&faces_[c >> 2]); }

    std::size_t face_count() const { return faces_.size(); }
    bool gone(std::uint32_t face) const { return faces_[face].vertices[0] == none; }
    void remove(std::uint32_t face) { faces_[face].vertices[0] = none; }

    /// One corner of each vertex, the rightmost where it is on a border; `none` where no face has it.
    const Array<Corner>& first_corners() const { return first_; }
    void drop_first_corners() { first_ = {}; }

 private:
    struct Outgoing;
    struct Defects;

    Defects match(const Outgoing& outgoing);
    std::uint64_t find_fans(const Outgoing& outgoing);

    Array<Face> faces_;
    Array<Corner> first_;
};

}  // namespace vdbgeo
