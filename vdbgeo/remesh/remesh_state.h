// A half-edge mesh that lies on an input surface, and the changes that keep it a good mesh of it.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "vdbgeo/core/half_edge_mesh.h"
#include "vdbgeo/remesh/input_surface.h"

namespace vdbgeo {

/// Twice the area times the normal.
inline Vec3d area_vector(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return (b - a).cross(c - a); }

/// The cosine of a triangle's least angle; 1 without area.
inline double least_angle_cosine(const Vec3d& p, const Vec3d& q, const Vec3d& r) {
    double a = (q - r).squaredNorm(), b = (r - p).squaredNorm(), c = (p - q).squaredNorm();
    if (a > b) std::swap(a, b);
    if (a > c) std::swap(a, c);
    const double product = b * c;
    return product > 0 ? std::min(1.0, (b + c - a) / (2 * std::sqrt(product))) : 1;
}

/// Where a vertex of the remeshed surface lies on the input.
struct VertexSite {
    std::uint32_t place = 0;  ///< the input's face; for those on lines the segment
    float length = 0;         ///< Å, that edges here should have
    bool dust = false;        ///< of a piece that is only polished
    InputSurface::Kind kind = InputSurface::Kind::free;
};

/// Every change keeps the topology, the lines (see InputSurface), and the faces from turning over; one that
/// would not is left out. Handles are OpenMesh's.
class RemeshState {
 public:
    using VertexHandle = OpenMesh::VertexHandle;
    using HalfedgeHandle = OpenMesh::HalfedgeHandle;
    using EdgeHandle = OpenMesh::EdgeHandle;
    using FaceHandle = OpenMesh::FaceHandle;
    using Kind = InputSurface::Kind;
    static constexpr std::uint32_t none = FaceAdjacency::none;

    /// `lengths`: one for each vertex of the input, or one for all; negative: the piece is only polished.
    RemeshState(const InputSurface& input, const std::vector<float>& lengths);

    /// Splits every edge longer than `factor` times its length.
    void split_long(double factor);
    /// Collapses edges shorter than `factor` times their length unless one longer than `limit` times its
    /// length would come of it.
    void collapse_short(double factor, double limit);
    /// Flips edges towards six edges a vertex, four at borders.
    void flip_for_valence();
    /// Flips edges whose two faces have a larger least angle afterwards.
    void flip_for_angles();
    /// Moves every vertex `step` of the way to the centre of its faces, within the tangent plane, and back
    /// onto the input. From old places to new ones, in parallel.
    void relax(double step);
    /// Drops what is deleted from the arrays.
    void compact() { mesh_.garbage_collection(); }

    /// The mesh with its vertices' and faces' properties from the input.
    TriMesh result() const;

    HalfEdgeMesh& mesh() { return mesh_; }
    const HalfEdgeMesh& mesh() const { return mesh_; }
    const InputSurface& input() const { return input_; }
    const Vec3d& point(VertexHandle v) const { return mesh_.point(v); }
    VertexSite& site(VertexHandle v) { return mesh_.property(sites_, v); }
    const VertexSite& site(VertexHandle v) const { return mesh_.property(sites_, v); }
    bool is_line(EdgeHandle e) const { return mesh_.property(lines_, e) != none; }
    double length(VertexHandle a, VertexHandle b) const { return 0.5 * (site(a).length + site(b).length); }

    /// A point of the input near p, downhill from where `start` lies, with its site.
    struct Landing {
        Vec3d point = Vec3d::Zero();
        VertexSite site = {};
    };
    Landing land(const Vec3d& p, const VertexSite& start) const;

    /// Topology and lines allow it.
    bool can_flip(EdgeHandle e) const;
    /// Whether the faces after the flip look the way the faces before do.
    bool flip_keeps_side(EdgeHandle e) const;
    /// Whether topology and lines allow v_from → v_to, and which site the vertex that stays must have.
    bool can_collapse(HalfedgeHandle h);
    /// A collapse that can be: `at` is where v_to goes.
    void collapse(HalfedgeHandle h, const Landing& at);
    /// Where the vertex of a collapse goes: to the corner, onto the line, else half way.
    Landing collapse_landing(HalfedgeHandle h) const;
    void split(EdgeHandle e, const Landing& at);
    Landing split_landing(EdgeHandle e) const;

 private:
    bool collapse_keeps_shape(HalfedgeHandle h, const Landing& at, double limit);
    bool ring_keeps_shape(VertexHandle v, VertexHandle other, const Landing& at, double limit) const;
    EdgeHandle longest_near(EdgeHandle e) const;
    double squared_length(EdgeHandle e) const;
    bool is_long(EdgeHandle e, double factor) const;
    bool is_settled(EdgeHandle e) const;
    int valence_gain(EdgeHandle e) const;
    Vec3d relaxed(VertexHandle v, double step) const;
    void set_interpolated_length(VertexSite& site, const Vec3d& weights) const;
    void undo_turned_faces(const std::vector<Landing>& old);
    void add_face_properties(const std::vector<int>& faces, TriMesh& out) const;
    void add_vertex_properties(const std::vector<int>& vertices, TriMesh& out) const;

    const InputSurface& input_;
    const std::vector<float>& lengths_;
    HalfEdgeMesh mesh_;
    OpenMesh::VPropHandleT<VertexSite> sites_;
    OpenMesh::EPropHandleT<std::uint32_t>
        lines_;  ///< a segment of the input's line that an edge follows, or none
    OpenMesh::FPropHandleT<float> caps_;
};

}  // namespace vdbgeo
