// A tetrahedral mesh while it is optimised: its tetrahedra by vertex, and what each is worth. For
// tet_optimize.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"
#include "vdbgeo/tet/tet_angles.h"

namespace vdbgeo {

/// How a vertex may move.
enum class VertexFreedom : std::uint8_t { fixed, surface, free };

/// The tetrahedra around a vertex.
struct TetSpan {
    const std::uint32_t *first, *last;

    const std::uint32_t* begin() const { return first; }
    const std::uint32_t* end() const { return last; }
    std::size_t size() const { return static_cast<std::size_t>(last - first); }
};

/// Points, tetrahedra, the tetrahedra around each vertex and the boundary's triangles around each vertex of
/// it. Tetrahedra are replaced in place; the slots of those that went are dead until used again.
class TetStore {
 public:
    /// Throws InvalidInput for tetrahedra that are turned over, and as tet_adjacency does.
    TetStore(const TetMesh& mesh, const DihedralBounds& bounds, bool surface_moves);

    const DihedralBounds& bounds() const { return bounds_; }
    std::size_t vertex_count() const { return points_.size(); }
    std::size_t slot_count() const { return tets_.size(); }

    const Vec3d& point(VertexId v) const { return points_[v]; }
    const Tetrahedron& tet(std::uint32_t t) const { return tets_[t]; }
    std::int32_t region(std::uint32_t t) const { return regions_.empty() ? 1 : regions_[t]; }
    VertexFreedom freedom(VertexId v) const { return freedom_[v]; }
    /// What the worst angle of a tetrahedron is worth, see DihedralBounds; infinity for a dead slot.
    double worth(std::uint32_t t) const { return worth_[t]; }
    double worth_of(const Tetrahedron& t) const {
        return dihedral_worth(bounds_, points_[t[0]], points_[t[1]], points_[t[2]], points_[t[3]]);
    }
    TetSpan star(VertexId v) const {
        const std::uint32_t* first = pool_.data() + stars_[v].begin;
        return {first, first + stars_[v].count};
    }
    /// The boundary's triangles around v, counter-clockwise seen from outside and turned so that v is first.
    template <class Body>
    void for_fan(VertexId v, const Body& body) const {
        for (std::size_t i = fan_start_[v]; i < fan_start_[v + std::size_t{1}]; ++i) body(fans_[i]);
    }
    /// The other tetrahedron on the triangle of t opposite its corner k; slot_count() where there is none.
    std::uint32_t across(std::uint32_t t, std::size_t k) const;
    bool share_tet(VertexId a, VertexId b) const;

    /// Tetrahedra that are worth less than `goal`, in order.
    std::vector<std::uint32_t> worse_than(double goal) const;

    /// Moves v, and marks the vertices around as changed at `epoch`. May be called at once for vertices that
    /// share no tetrahedron.
    void move(VertexId v, const Vec3d& to, std::uint32_t epoch);
    /// Puts `fresh` tetrahedra, all of one region, in the place of `old`.
    void replace(const std::vector<std::uint32_t>& old, const std::vector<Tetrahedron>& fresh,
                 std::uint32_t epoch);

    /// When a tetrahedron around v changed last.
    std::uint32_t changed(VertexId v) const { return changed_[v].load(std::memory_order_relaxed); }
    /// When a tetrahedron that touches this one changed last.
    std::uint32_t changed_around(std::uint32_t t) const {
        const Tetrahedron& c = tets_[t];
        return std::max({changed(c[0]), changed(c[1]), changed(c[2]), changed(c[3])});
    }

    /// Gives the points and the tetrahedra that are left to `mesh`, in order, without its faces.
    void give_to(TetMesh& mesh);

 private:
    struct Star {
        std::uint64_t begin;
        std::uint32_t count, capacity;
    };

    void set_boundary(const TetMesh& mesh, bool surface_moves);
    void mark(VertexId v, std::uint32_t epoch) { changed_[v].store(epoch, std::memory_order_relaxed); }
    void add_to_star(VertexId v, std::uint32_t t);
    void take_from_star(VertexId v, std::uint32_t t);

    DihedralBounds bounds_;
    Array<Vec3d> points_;
    Array<Tetrahedron> tets_;
    Array<std::int32_t> regions_;
    Array<double> worth_;
    Array<VertexFreedom> freedom_;
    Array<Star> stars_;
    Array<std::uint32_t> pool_;
    Array<std::uint64_t> fan_start_;
    Array<Triangle> fans_;
    std::vector<std::atomic<std::uint32_t>> changed_;
    std::vector<std::uint32_t> dead_;
};

}  // namespace vdbgeo
