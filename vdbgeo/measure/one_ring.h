// The faces at one vertex, ready for sums over them; and what every estimate of curvature asks of a mesh.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/curvature.h"

namespace vdbgeo {

/// The corners at one vertex of the faces that are no caps. Made once a thread and filled for vertex after
/// vertex.
class OneRing {
 public:
    OneRing(const TriMesh& mesh, const VertexFaces& faces);

    void fill(VertexId v);

    VertexId vertex() const { return vertex_; }
    std::size_t size() const { return size_; }
    /// Face k runs from the vertex to out(k), from there to in(k), and back.
    VertexId out(std::size_t k) const { return out_[k]; }
    VertexId in(std::size_t k) const { return in_[k]; }
    std::uint32_t face(std::size_t k) const { return face_[k]; }
    bool only_caps() const { return size_ == 0 && any_; }

    /// The flags of the vertex; `area`: whether a face has one. Adds to `misoriented` where two faces run
    /// through an edge in the same direction.
    std::uint8_t flags(bool area, std::uint64_t& misoriented);
    /// Whether a face has an area.
    bool has_area() const;

 private:
    enum class Fan { closed, open, other };

    Fan fan() const;
    std::uint8_t flags_of_star(std::uint64_t& misoriented);

    const TriMesh& mesh_;
    const VertexFaces& faces_;
    const float* caps_ = nullptr;
    VertexId vertex_ = 0;
    std::size_t size_ = 0;
    bool any_ = false;
    std::vector<VertexId> out_, in_;
    std::vector<std::uint32_t> face_;
    VertexStar star_;
};

/// Throws InvalidInput for a mesh that check() refuses and for coordinates too large for its edges.
void check_curvature_input(const TriMesh& mesh, const char* stage);
/// Throws InvalidInput where the number of vertices with misoriented faces is not 0.
void check_oriented(std::uint64_t misoriented, const char* stage);
/// Over the sides of all faces, Å: inner edges count twice. 0 without faces.
double mean_edge(const TriMesh& mesh);

}  // namespace vdbgeo
