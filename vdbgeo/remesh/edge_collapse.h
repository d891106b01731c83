// Greedy quadric edge collapses on a manifold.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"
#include "vdbgeo/remesh/bucket_queue.h"
#include "vdbgeo/remesh/corner_table.h"
#include "vdbgeo/remesh/quadric.h"

namespace vdbgeo {

/// The engine of `simplify`: the mesh as corners and quadrics in about 60 bytes a face, and the queue of each
/// vertex's cheapest edge. An edge belongs to the lower-numbered of its vertices.
class EdgeCollapse {
 public:
    /// What a collapse would make: the faces (centre, fan[i].first, fan[i].second). `error` is the mean
    /// squared distance of the centre to the planes that it stands for.
    struct Proposal {
        Vec3f centre;
        std::vector<std::pair<Vec3f, Vec3f>> fan;
        double error = 0;
    };
    using Allowed = std::function<bool(const Proposal&)>;

    /// Throws InvalidInput, with `stage` in front, for a mesh that is no oriented manifold.
    EdgeCollapse(const TriMesh& mesh, const std::string& stage);

    /// Collapses edges, the cheapest first, until no more than `faces` are left or nothing can be collapsed.
    void run(std::uint64_t faces, const Allowed& allowed, const Progress& progress);

    std::uint64_t faces_left() const { return faces_left_; }

    /// The mesh as it is now. `input` is the mesh of the constructor, for the properties: a face keeps its
    /// own, a vertex has those of the input's vertex that it comes from.
    TriMesh mesh(const TriMesh& input) const;

 private:
    using Corner = CornerTable::Corner;
    static constexpr std::uint32_t none = CornerTable::none;

    enum class Freedom : std::uint8_t { free, line, fixed };  ///< line: on a border or the rim of a cap

    /// An edge of a known vertex, in the order in which edges are tried.
    struct Best {
        float cost = std::numeric_limits<float>::infinity();
        VertexId target = none;  ///< the other end; `none`: no edge, and not in the queue

        bool operator<(const Best& other) const {
            return cost != other.cost ? cost < other.cost : target < other.target;
        }
    };
    static constexpr Best lowest_floor{-1, 0};

    /// One cache line.
    struct alignas(64) Vertex {
        float position[3];
        Quadric<float> quadric;  ///< relative to the position
        Corner corner;           ///< any of the vertex's; `none`: the vertex is gone
        Best best;               ///< its cheapest edge, by which it is queued
    };

    /// The corners of a vertex counter-clockwise, and its neighbours: neighbours[i] is before corners[i]. On
    /// a border there is one neighbour more.
    struct Ring {
        std::vector<Corner> corners;
        std::vector<VertexId> neighbours;

        void clear() {
            corners.clear();
            neighbours.clear();
        }
    };

    struct Placement {
        double cost;  ///< infinite: the edge cannot be collapsed
        Vec3d point;  ///< relative to the first vertex
    };

    /// The faces at an edge a → b: corner of a in the face to its left and in the face to its right.
    struct EdgeFaces {
        Corner left = none, right = none;
    };

    void set_up(VertexId v);
    bool is_cap(std::uint32_t face) const { return !caps_.empty() && caps_[face]; }
    bool is_line(Corner c) const;
    Vec3d position(VertexId v) const {
        const float(&p)[3] = vertices_[v].position;
        return {double(p[0]), double(p[1]), double(p[2])};
    }
    void gather(VertexId v, Ring& ring) const;
    bool spoke_is_line(const Ring& ring, std::size_t i) const;
    Placement place(VertexId a, VertexId b, bool line) const;

    EdgeFaces edge_faces(VertexId b) const;
    bool keeps_topology(const EdgeFaces& faces) const;
    bool keeps_shape(VertexId v, const Ring& ring, const EdgeFaces& faces, const Vec3f& to);

    Best find_best(VertexId v, const Ring& ring, const Best& floor) const;
    void unqueue(VertexId v);
    void enqueue(VertexId v, const Best& best);
    void enqueue_all();
    void prefetch_next(VertexId v) const;
    bool try_collapse(VertexId a, const Allowed& allowed);
    void merge(VertexId a, VertexId b, const EdgeFaces& faces, const Vec3f& to);
    void remove_face(Corner at_a, Corner at_b);
    void requeue_around(VertexId a, VertexId b);

    CornerTable table_;
    Array<Vertex> vertices_;
    std::vector<Freedom> freedom_;
    std::vector<char> caps_;  ///< empty where there are none
    Array<VertexId> source_;  ///< whose properties a vertex has; empty where there are none
    BucketQueue queue_;
    std::uint64_t faces_left_;
    Ring ring_a_, ring_b_;
    Proposal proposal_;
};

}  // namespace vdbgeo
