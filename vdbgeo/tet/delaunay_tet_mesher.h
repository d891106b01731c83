// Delaunay refinement of solids that are known as functions of place, on CGAL's Mesh_3. What is particular to
// maps, label maps and surfaces is in delaunay_tetrahedra.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo {

/// Regions of space, told from each other by place alone. May be asked from several threads.
class TetDomain {
 public:
    virtual ~TetDomain() = default;

    /// The region at a place; 0 is outside.
    virtual std::int32_t region(const Vec3d& place) const = 0;

    /// A place between a and b where one region ends and another begins, and these two.
    struct Crossing {
        Vec3d place;
        std::array<std::int32_t, 2> regions;
    };
    /// Between a in region ra and b in another one, rb. As made here: by halving, down to `tolerance`; where
    /// there are several crossings, the first from a that halving meets.
    virtual Crossing crossing(const Vec3d& a, std::int32_t ra, const Vec3d& b, std::int32_t rb) const;

 protected:
    explicit TetDomain(double tolerance) : tolerance_(tolerance) {}

    double tolerance_;
};

/// A point on the boundary of a domain and the two regions that meet there.
using BoundarySeed = TetDomain::Crossing;

/// Lengths in the domain's unit.
struct TetMesherBounds {
    Vec3d low, high;  ///< of a box around everything that is not outside
    double facet_angle_deg = 25, facet_size = 0, facet_distance = 0, cell_radius_edge = 2, cell_size = 0;
    /// Factors by which `facet_size` and `cell_size` are lowered at a place, at most 1; empty: 1 everywhere.
    std::function<std::array<double, 2>(const Vec3d&)> graded;
    /// Whether the boundary has to be a manifold. Not where three regions meet.
    bool manifold = false;
    std::uint64_t max_vertices = 0;
    double max_seconds = 0;
};

struct TetMesherOptimization {
    bool lloyd = false, odt = false, perturb = false, exude = false;
    double sliver_bound_deg = 12;
};

/// A restricted Delaunay triangulation under refinement. Every step throws NumericalError where a cap is
/// reached, and Cancelled; the mesher is of no use then.
class TetMesher {
 public:
    virtual ~TetMesher() = default;

    virtual void insert(const std::vector<BoundarySeed>& seeds) = 0;
    enum class Extent { boundary, everything };
    /// Until every bound holds, or those on the boundary (which need not be a manifold then). `expected`
    /// vertices, for the progress. Where a boundary that has to be a manifold touches itself in a point, no
    /// refinement can mend that: after 20000 triangles of less than 1/512 of the facet size it is left as it
    /// is.
    virtual void refine(Extent extent, double expected, const Progress& progress) = 0;
    /// For each seed so far: whether both its regions have a tetrahedron at it.
    virtual std::vector<char> seeds_met() const = 0;
    virtual void optimize(const TetMesherOptimization& what, const Progress& progress) = 0;
    /// Points, tetrahedra (positively oriented) and regions, in no particular order.
    virtual TetMesh mesh() const = 0;
};

/// Whether this build has CGAL; the two functions below throw where it has not.
bool have_tet_mesher();

/// One thread, always the same result.
std::unique_ptr<TetMesher> make_tet_mesher(const TetDomain& domain, const TetMesherBounds& bounds);
/// As many threads as TBB gives; the result depends on how they are scheduled.
std::unique_ptr<TetMesher> make_parallel_tet_mesher(const TetDomain& domain, const TetMesherBounds& bounds);

}  // namespace vdbgeo
