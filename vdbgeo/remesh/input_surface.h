// The surface that a remesher keeps to: nearest points by walking over it, and the lines that must stay.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "vdbgeo/core/face_adjacency.h"
#include "vdbgeo/core/tri_mesh.h"

namespace vdbgeo {

/// Walks downhill in distance from face to face. Unlike a search of the whole mesh a walk stays on its own
/// sheet where two sheets come near each other, and it costs a few triangles. Refers to the mesh and its
/// adjacency; read-only, so any thread may ask.
class InputSurface {
 public:
    static constexpr std::uint32_t none = FaceAdjacency::none;

    /// Edges between faces of different caps and borders are lines; edges where the surface turns by more
    /// than `feature_angle_deg` too, and by more than 45° between two faces of a cap. Where more or fewer
    /// than two lines meet, or one turns by more than 45° (or the feature angle), also seen over `length`, is
    /// a corner.
    InputSurface(const TriMesh& mesh, const FaceAdjacency& adjacency, std::optional<double> feature_angle_deg,
                 double length);

    /// A point of a face by its weights at the corners.
    struct Spot {
        Vec3d point = Vec3d::Zero();
        Vec3d weights = Vec3d::Zero();
        std::uint32_t face = 0;
        double squared_distance = 0;
    };
    /// The nearest point of one face.
    Spot on_face(const Vec3d& p, std::uint32_t face) const;
    /// A point nearer than all around it, downhill from `face`.
    Spot nearest(const Vec3d& p, std::uint32_t face) const;

    struct LineSpot {
        Vec3d point = Vec3d::Zero();
        std::uint32_t segment = 0;
        double squared_distance = 0;
    };
    /// The same along the line of `segment`, no further than its corners.
    LineSpot nearest_on_line(const Vec3d& p, std::uint32_t segment) const;

    enum class Kind : std::uint8_t { free, line, corner };
    Kind kind(VertexId v) const { return kind_.empty() ? Kind::free : kind_[v]; }
    /// The line that a half-edge is a segment of: the lower half-edge of its edge; none.
    std::uint32_t segment(std::uint32_t h) const { return line_.empty() || !line_[h] ? none : lower(h); }
    /// One of the segments at a vertex on a line.
    std::uint32_t segment_at(VertexId v) const { return lines_[v][0]; }

    const TriMesh& mesh() const { return mesh_; }
    const FaceAdjacency& adjacency() const { return adjacency_; }
    /// Of unit length; zero for a face without area.
    Vec3d normal(std::uint32_t face) const;

 private:
    Vec3d point(VertexId v) const { return mesh_.points[v].cast<double>(); }
    VertexId from(std::uint32_t h) const { return mesh_.triangles[h / 3][h % 3]; }
    VertexId to(std::uint32_t h) const { return mesh_.triangles[h / 3][(h + 1) % 3]; }
    std::uint32_t lower(std::uint32_t h) const { return std::min(h, adjacency_.twin[h]); }
    bool turns(std::uint32_t h, double angle_deg) const;
    void find_lines(std::optional<double> feature_angle_deg);
    void find_corners(double angle_deg, double length);
    bool bends(VertexId v, double cosine, double length) const;

    const TriMesh& mesh_;
    const FaceAdjacency& adjacency_;
    std::vector<bool> line_;                           ///< of each half-edge; empty where there are no lines
    std::vector<Kind> kind_;                           ///< of each vertex; likewise
    std::vector<std::array<std::uint32_t, 2>> lines_;  ///< the segments at each vertex on a line; likewise
};

}  // namespace vdbgeo
