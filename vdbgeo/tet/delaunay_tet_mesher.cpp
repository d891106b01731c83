// Compiled twice: as it is, and by delaunay_tet_mesher_parallel.cpp on CGAL's parallel triangulation.
#include "vdbgeo/tet/delaunay_tet_mesher.h"

#include "vdbgeo/core/errors.h"

#ifdef VDBGEO_HAS_CGAL

// The intersection of a dual edge with the boundary tells by itself whether there is one.
#define CGAL_MESH_3_NO_LONGER_CALLS_DO_INTERSECT_3
#ifdef VDBGEO_PARALLEL_TET_MESHER
#define CGAL_CONCURRENT_COMPACT_CONTAINER_APPROXIMATE_SIZE 1
#endif
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_3/Mesher_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Random.h>
#include <CGAL/Spatial_sort_traits_adapter_3.h>
#include <CGAL/exude_mesh_3.h>
#include <CGAL/lloyd_optimize_mesh_3.h>
#include <CGAL/odt_optimize_mesh_3.h>
#include <CGAL/perturb_mesh_3.h>
#include <CGAL/refine_mesh_3.h>
#include <CGAL/spatial_sort.h>
#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <mutex>
#include <numeric>

namespace vdbgeo {
namespace {

using Clock = std::chrono::steady_clock;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

#ifdef VDBGEO_PARALLEL_TET_MESHER
constexpr bool parallel = true;
using Concurrency = CGAL::Parallel_tag;
#else
constexpr bool parallel = false;
using Concurrency = CGAL::Sequential_tag;
#endif

template <class P>
Vec3d vec(const P& p) {
    return {p.x(), p.y(), p.z()};
}
Point point(const Vec3d& p) { return {p.x(), p.y(), p.z()}; }

/// What CGAL calls a mesh domain.
class Domain {
 public:
    using R = Kernel;
    using Geom_traits = Kernel;
    using FT = double;
    using Point_3 = Point;
    using Segment_3 = Kernel::Segment_3;
    using Ray_3 = Kernel::Ray_3;
    using Line_3 = Kernel::Line_3;
    using Vector_3 = Kernel::Vector_3;
    using Bbox_3 = CGAL::Bbox_3;
    using Has_features = CGAL::Tag_false;

    using Subdomain_index = std::int32_t;
    /// The two regions, the smaller first.
    using Surface_patch_index = std::pair<std::int32_t, std::int32_t>;
    /// A patch, or a region and −1.
    using Index = std::pair<std::int32_t, std::int32_t>;
    using Subdomain = boost::optional<Subdomain_index>;
    using Surface_patch = boost::optional<Surface_patch_index>;
    using Intersection = std::tuple<Point_3, Index, int>;

    Domain(const TetDomain& domain, const Vec3d& low, const Vec3d& high)
        : domain_(&domain), low_(low), high_(high) {}

    Bbox_3 bbox() const { return {low_.x(), low_.y(), low_.z(), high_.x(), high_.y(), high_.z()}; }

    static Surface_patch_index patch(const std::array<std::int32_t, 2>& regions) {
        return {std::min(regions[0], regions[1]), std::max(regions[0], regions[1])};
    }
    static Index index_from_surface_patch_index(const Surface_patch_index& p) { return p; }
    static Index index_from_subdomain_index(Subdomain_index region) { return {region, -1}; }
    static Surface_patch_index surface_patch_index(const Index& index) { return index; }
    static Subdomain_index subdomain_index(const Index& index) { return index.first; }

    struct Is_in_domain {
        const Domain& domain;
        Subdomain operator()(const Point& p) const {
            const std::int32_t region = domain.region(vec(p));
            return region == 0 ? Subdomain() : Subdomain(region);
        }
    };
    Is_in_domain is_in_domain_object() const { return {*this}; }

    struct Construct_intersection {
        const Domain& domain;
        Intersection operator()(const Segment_3& s) const {
            return domain.intersect(vec(s.source()), vec(s.target()));
        }
        /// Rays end in the outside.
        Intersection operator()(const Ray_3& r) const {
            const Vec3d from = vec(r.source());
            const Vec3d along = vec(r.to_vector()).normalized();
            if (!along.allFinite() || domain.region(from) == 0) return {};
            return domain.intersect(from, from + 1.01 * (domain.high_ - domain.low_).norm() * along);
        }
        /// Of a flat triangulation, which there is none of.
        Intersection operator()(const Line_3&) const { return {}; }
    };
    Construct_intersection construct_intersection_object() const { return {*this}; }

 private:
    std::int32_t region(const Vec3d& p) const {
        for (int a = 0; a < 3; ++a)
            if (!(p[a] >= low_[a] && p[a] <= high_[a])) return 0;
        return domain_->region(p);
    }

    Intersection intersect(Vec3d a, Vec3d b) const {
        const std::int32_t ra = region(a), rb = region(b);
        if (ra == rb) return {};
        // Circumcentres of flat tetrahedra are far away.
        if (ra == 0) clip(b, a);
        if (rb == 0) clip(a, b);
        const TetDomain::Crossing crossing = domain_->crossing(a, ra, b, rb);
        return {point(crossing.place), patch(crossing.regions), 2};
    }
    /// Moves `to` to where the line from `from`, which is in the box, leaves the box.
    void clip(const Vec3d& from, Vec3d& to) const {
        double t = 1;
        for (int a = 0; a < 3; ++a) {
            const double d = to[a] - from[a];
            if (to[a] > high_[a]) t = std::min(t, (high_[a] - from[a]) / d);
            if (to[a] < low_[a]) t = std::min(t, (low_[a] - from[a]) / d);
        }
        if (t < 1) to = from + t * (to - from);
    }

    const TetDomain* domain_;
    Vec3d low_, high_;
};

using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, Concurrency>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
using Vertex = Triangulation::Vertex_handle;
using Cell = Triangulation::Cell_handle;
using Facet = Triangulation::Facet;

std::size_t vertex_count(const Triangulation& t) {
#ifdef VDBGEO_PARALLEL_TET_MESHER
    return t.tds().vertices().approximate_size();
#else
    return t.number_of_vertices();
#endif
}

/// Caps, progress, and what has to end the refinement early. Asked by every thread.
class Watch {
 public:
    explicit Watch(const TetMesherBounds& bounds)
        : bounds_(bounds),
          deadline_(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                       std::chrono::duration<double>(bounds.max_seconds))) {}

    std::atomic<bool> stop{false};
    std::atomic<bool> runaway{false};

    void begin(double expected, const Progress& progress) {
        expected_ = std::max(1.0, expected);
        reported_ = 0;
        progress_ = progress;
    }
    /// Often; never throws.
    void tick(const Triangulation& t) {
        if ((ticks_.fetch_add(1, std::memory_order_relaxed) & 0x3FF) != 0) return;
        const std::lock_guard<std::mutex> lock(mutex_);
        if (failure_) return;
        try {
            const std::size_t vertices = vertex_count(t);
            check(vertices);
            const double part = static_cast<double>(vertices) / expected_;
            advance(part < 0.5 ? part : 1 - 0.25 / part);  // never quite 1
        } catch (...) {
            failure_ = std::current_exception();
            stop = true;
        }
    }
    /// A facet far below every bound was met: the manifold criterion follows a place without end.
    void tiny_facet() {
        if (!limit_tiny_ || tiny_.fetch_add(1, std::memory_order_relaxed) < most_tiny) return;
        runaway = true;
        stop = true;
    }
    void limit_tiny(bool limited) {
        limit_tiny_ = limited;
        tiny_ = 0;
        runaway = false;
        if (!failure_) stop = false;
    }
    void rethrow() {
        if (failure_) std::rethrow_exception(failure_);
    }
    /// From one thread, where an exception may pass.
    void step(double part) {
        check(0);
        advance(part);
    }
    double seconds_left() const { return std::chrono::duration<double>(deadline_ - Clock::now()).count(); }
    void check(std::size_t vertices) const {
        if (vertices >= bounds_.max_vertices)
            throw NumericalError(
                fmt::format("Delaunay refinement reached the bound of {} vertices: try larger sizes, or "
                            "allow more vertices",
                            bounds_.max_vertices));
        if (Clock::now() > deadline_)
            throw NumericalError(
                fmt::format("Delaunay tetrahedra were not ready within {:g} s: try larger sizes, fewer "
                            "optimisers, or allow more time",
                            bounds_.max_seconds));
    }

 private:
    static constexpr std::uint64_t most_tiny = 20000;

    void advance(double part) {
        reported_ = std::max(reported_, part);
        progress_.report(reported_);
    }

    const TetMesherBounds& bounds_;
    const Clock::time_point deadline_;
    Progress progress_;
    double expected_ = 1, reported_ = 0;
    bool limit_tiny_ = false;
    std::atomic<std::uint64_t> ticks_{0}, tiny_{0};
    std::mutex mutex_;
    std::exception_ptr failure_;
};

/// The least first: which bound is broken, then how badly (0…1, 0 worst).
using Quality = std::pair<int, double>;
using Fault = boost::optional<Quality>;

class FacetCriteria {
 public:
    using Facet_quality = Quality;
    using Is_facet_bad = Fault;

    FacetCriteria(const TetMesherBounds& bounds, Watch& watch) : bounds_(&bounds), watch_(&watch) {
        const double s = std::sin(bounds.facet_angle_deg * M_PI / 180);
        sine_squared_ = s * s;
    }

    Fault operator()(const Triangulation& t, const Facet& f) const {
        watch_->tick(t);
        std::array<Vec3d, 3> p;
        bool on_boundary = true;
        for (int k = 0; k < 3; ++k) {
            const Vertex v = f.first->vertex((f.second + k + 1) & 3);
            p[static_cast<std::size_t>(k)] = vec(v->point());
            on_boundary = on_boundary && v->in_dimension() <= 2;
        }
        const Vec3d centre = vec(f.first->get_facet_surface_center(f.second));
        const double size = bounds_->facet_size * (bounds_->graded ? bounds_->graded(centre)[0] : 1);
        const double ball = (p[0] - centre).squaredNorm();
        if (ball > size * size) return Quality(0, size * size / ball);
        if (ball < tiny_ * tiny_ * bounds_->facet_size * bounds_->facet_size) watch_->tiny_facet();
        if (!on_boundary) return Quality(1, 0);
        return shape(p, centre, ball);
    }

 private:
    Fault shape(const std::array<Vec3d, 3>& p, const Vec3d& centre, double ball) const {
        const Vec3d u = p[1] - p[0], v = p[2] - p[0], n = u.cross(v);
        const double area = n.squaredNorm();  // (2·area)²
        const double uu = u.squaredNorm(), vv = v.squaredNorm(), ww = (u - v).squaredNorm();
        const Vec3d circum = p[0] + (uu * v.cross(n) + vv * n.cross(u)) / (2 * area);
        const double off = (circum - centre).squaredNorm();
        const double allowed = bounds_->facet_distance * bounds_->facet_distance;
        if (!(off <= allowed)) return Quality(2, std::min(1.0, allowed / off));
        // sin² of the least angle = (2·area)² · the shortest side² / product of the sides². At creases, which
        // have no triangles of such angles, this ends at some ten thousandth of the size.
        const double sine = area * std::min({uu, vv, ww}) / (uu * vv * ww);
        if (!(sine >= sine_squared_) && ball > 1e-7 * bounds_->facet_size * bounds_->facet_size)
            return Quality(3, sine);
        return {};
    }

    const TetMesherBounds* bounds_;
    Watch* watch_;
    static constexpr double tiny_ = 1.0 / 512;
    double sine_squared_ = 0;
};

class CellCriteria {
 public:
    using Cell_quality = Quality;
    using Is_cell_bad = Fault;

    CellCriteria(const TetMesherBounds& bounds, Watch& watch, const bool& boundary_only)
        : bounds_(&bounds), watch_(&watch), boundary_only_(&boundary_only) {}

    Fault operator()(const Triangulation& t, const Cell& c) const {
        watch_->tick(t);
        if (*boundary_only_) return {};
        std::array<Vec3d, 4> p;
        for (int k = 0; k < 4; ++k) p[static_cast<std::size_t>(k)] = vec(c->vertex(k)->point());
        const Vec3d centre = vec(t.dual(c));
        const double radius = (p[0] - centre).squaredNorm();
        const double size = bounds_->cell_size * (bounds_->graded ? bounds_->graded(centre)[1] : 1);
        if (radius > size * size) return Quality(0, size * size / radius);
        double shortest = std::numeric_limits<double>::infinity();
        for (const auto& [a, b] : tet_edges)
            shortest = std::min(
                shortest, (p[static_cast<std::size_t>(a)] - p[static_cast<std::size_t>(b)]).squaredNorm());
        const double bound = bounds_->cell_radius_edge * bounds_->cell_radius_edge * shortest;
        if (radius > bound && radius > 1e-10 * bounds_->cell_size * bounds_->cell_size)
            return Quality(1, bound / radius);
        return {};
    }

 private:
    const TetMesherBounds* bounds_;
    Watch* watch_;
    const bool* boundary_only_;
};

struct Criteria {
    using Facet_criteria = FacetCriteria;
    using Cell_criteria = CellCriteria;
    FacetCriteria facet;
    CellCriteria cell;
    const FacetCriteria& facet_criteria_object() const { return facet; }
    const CellCriteria& cell_criteria_object() const { return cell; }
};

/// What CGAL's optimisers call as they go: from one thread only, and only then may it throw.
class Visitor {
 public:
    Visitor(Watch& watch, double from, double to) : watch_(&watch), from_(from), to_(to) {}

    void bound_reached(double) { tick(); }
    void end_of_perturbation_iteration(std::size_t left) { count_down(left); }
    void after_cell_pumped(std::size_t left) { count_down(left); }
    void after_compute_moves() { watch_->step(from_); }
    void after_move_points() { watch_->step(from_); }
    void after_rebuild_restricted_delaunay() { watch_->step(from_); }
    void end_of_iteration(int) { watch_->step(from_); }

 private:
    void count_down(std::size_t left) {
        most_ = std::max(most_, left);
        left_ = left;
        if ((++ticks_ & 0xF) == 0) tick();
    }
    void tick() {
        if (parallel) return;  // CGAL's threads hold locks here
        const double done =
            1 - static_cast<double>(left_) / static_cast<double>(std::max<std::size_t>(1, most_));
        watch_->step(from_ + (to_ - from_) * std::max(0.0, done));
    }

    Watch* watch_;
    double from_, to_;
    std::size_t most_ = 0, left_ = 0;
    std::uint64_t ticks_ = 0;
};

class Mesher final : public TetMesher {
 public:
    Mesher(const TetDomain& domain, const TetMesherBounds& bounds)
        : bounds_(bounds),
          domain_(domain, bounds.low, bounds.high),
          watch_(bounds_),
          criteria_{FacetCriteria(bounds_, watch_), CellCriteria(bounds_, watch_, boundary_only_)} {
        CGAL::get_default_random() = CGAL::Random(0);
    }

    void insert(const std::vector<BoundarySeed>& seeds) override;
    void refine(Extent extent, double expected, const Progress& progress) override;
    std::vector<char> seeds_met() const override;
    void optimize(const TetMesherOptimization& what, const Progress& progress) override;
    TetMesh mesh() const override;

 private:
    Triangulation& triangulation() { return complex_.triangulation(); }
    void refine_once(bool manifold);
    template <class Optimizer>
    CGAL::Mesh_optimization_return_code run_limited(Optimizer& optimizer, const Visitor& visitor);
    template <class Move>
    void smooth(const Visitor& visitor);
    void perturb(double bound, const Visitor& visitor);
    void exude(double bound, const Visitor& visitor);

    const TetMesherBounds bounds_;
    const Domain domain_;
    Watch watch_;
    bool boundary_only_ = false;
    const Criteria criteria_;
    Complex complex_;
    std::vector<Vertex> seed_vertices_;
    std::vector<std::array<std::int32_t, 2>> seed_regions_;
};

void Mesher::insert(const std::vector<BoundarySeed>& seeds) {
    std::vector<Point> points;
    points.reserve(seeds.size());
    for (const BoundarySeed& s : seeds) points.push_back(point(s.place));
    std::vector<std::ptrdiff_t> order(points.size());
    std::iota(order.begin(), order.end(), std::ptrdiff_t{0});
    using Places = CGAL::Spatial_sort_traits_adapter_3<Kernel, const Point*>;
    CGAL::spatial_sort(order.begin(), order.end(), Places(points.data()));
    const std::size_t first = seed_vertices_.size();
    seed_vertices_.resize(first + seeds.size());
    Triangulation& t = triangulation();
    t.set_lock_data_structure(nullptr);
    Cell near;
    for (const std::ptrdiff_t i : order) {
        watch_.tick(t);
        watch_.rethrow();
        const auto at = static_cast<std::size_t>(i);
        const std::size_t before = vertex_count(t);
        const Vertex v = t.insert(Triangulation::Weighted_point(points[at]), near);
        if (v == Vertex()) continue;
        near = v->cell();
        if (vertex_count(t) == before) continue;  // a vertex is there
        complex_.set_dimension(v, 2);
        complex_.set_index(v, Domain::patch(seeds[at].regions));
        seed_vertices_[first + at] = v;
    }
    for (const BoundarySeed& s : seeds) seed_regions_.push_back(s.regions);
}

void Mesher::refine_once(bool manifold) {
    using CGAL::parameters::internal::Manifold_options;
    const int topology = manifold ? Manifold_options::MANIFOLD : Manifold_options::NON_MANIFOLD;
    CGAL::Mesh_error_code error{};
    CGAL::Mesh_3::Mesher_3<Complex, Criteria, Domain> mesher(complex_, domain_, criteria_, topology,
                                                             bounds_.max_vertices, &error, &watch_.stop);
    mesher.refine_mesh("");
    complex_.clear_manifold_info();
    watch_.rethrow();
    if (error == CGAL::CGAL_MESH_3_MAXIMAL_NUMBER_OF_VERTICES_REACHED) watch_.check(bounds_.max_vertices);
}

void Mesher::refine(Extent extent, double expected, const Progress& progress) {
    watch_.begin(expected, progress);
    watch_.check(0);
    if (triangulation().dimension() < 3)
        throw NumericalError("the solid is too flat for Delaunay refinement");
    boundary_only_ = extent == Extent::boundary;
    watch_.limit_tiny(bounds_.manifold && !boundary_only_);
    refine_once(bounds_.manifold && !boundary_only_);
    if (watch_.runaway) {
        watch_.limit_tiny(false);
        refine_once(false);
    }
    watch_.step(1);
}

std::vector<char> Mesher::seeds_met() const {
    const Triangulation& t = complex_.triangulation();
    for (auto v = t.finite_vertices_begin(); v != t.finite_vertices_end(); ++v) v->set_meshing_info(-1);
    for (std::size_t s = 0; s < seed_vertices_.size(); ++s)
        if (seed_vertices_[s] != Vertex()) seed_vertices_[s]->set_meshing_info(static_cast<double>(s));
    std::vector<std::array<bool, 2>> met(seed_vertices_.size(), {false, false});
    for (auto c = t.all_cells_begin(); c != t.all_cells_end(); ++c) {
        const std::int32_t region =
            !t.is_infinite(c) && complex_.is_in_complex(c) ? complex_.subdomain_index(c) : 0;
        for (int k = 0; k < 4; ++k) {
            const Vertex v = c->vertex(k);
            if (t.is_infinite(v) || v->meshing_info() < 0) continue;
            const auto s = static_cast<std::size_t>(v->meshing_info());
            for (std::size_t side = 0; side < 2; ++side)
                if (seed_regions_[s][side] == region) met[s][side] = true;
        }
    }
    std::vector<char> out(met.size());
    for (std::size_t s = 0; s < out.size(); ++s)
        out[s] = seed_vertices_[s] == Vertex() || (met[s][0] && met[s][1]);
    return out;
}

/// Without a limit of time the result is always the same. CGAL's threads cannot be interrupted: they get
/// longer and longer turns.
template <class Optimizer>
CGAL::Mesh_optimization_return_code Mesher::run_limited(Optimizer& optimizer, const Visitor& visitor) {
    for (double turn = 1;; turn *= 2) {
        watch_.check(0);
        optimizer.set_time_limit(parallel ? std::min(turn, watch_.seconds_left() + 0.01) : 0);
        const auto end = optimizer(visitor);
        if (end != CGAL::TIME_LIMIT_REACHED) return end;
    }
}

template <class Move>
void Mesher::smooth(const Visitor& visitor) {
    constexpr int most_iterations = 10;
    constexpr double freeze = 0.01, convergence = 0.02;
    CGAL::Mesh_3::Mesh_global_optimizer<Complex, Domain, Move, Visitor> optimizer(complex_, domain_, freeze,
                                                                                  true, convergence);
    optimizer.set_time_limit(0);
    optimizer(most_iterations, visitor);
}

using Angle = CGAL::Mesh_3::Min_dihedral_angle_criterion<Triangulation>;

/// CGAL's perturber goes from bound to bound in steps of this criterion's unit and ends at the first that
/// some vertex cannot reach. With the bound as its unit it takes one step.
class Steps final : public Angle {
 public:
    Steps(double bound, const Triangulation& t, double step) : Angle(bound, t), step_(step) {}
    double get_perturbation_unit() const override { return step_; }

 private:
    double step_;
};

/// First as CGAL does; what the vertices that cannot be helped have held up is then tried at the last bound.
void Mesher::perturb(double bound, const Visitor& visitor) {
    using Perturber = CGAL::Mesh_3::Sliver_perturber<Complex, Domain, Steps, Visitor>;
    for (const double step : {1.0, bound}) {
        Perturber perturber(complex_, domain_, Steps(bound, triangulation(), step));
        const auto add = [&](auto* perturbation) { perturber.add_perturbation(perturbation); };
        const bool last = step == bound;
        add(new CGAL::Mesh_3::Sq_radius_perturbation<Complex, Domain, Steps>(last ? 20 : 40, 0.05));
        add(new CGAL::Mesh_3::Volume_perturbation<Complex, Domain, Steps>(last ? 10 : 40, 0.05));
        add(new CGAL::Mesh_3::Dihedral_angle_perturbation<Complex, Domain, Steps>(last ? 20 : 40, 0.05));
        add(new CGAL::Mesh_3::Li_random_perturbation<Complex, Domain, Steps>(last ? 20 : 100, 0.15));
        if (run_limited(perturber, visitor) == CGAL::BOUND_REACHED) break;
    }
}

void Mesher::exude(double bound, const Visitor& visitor) {
    CGAL::Mesh_3::Slivers_exuder<Complex, Angle, Visitor> exuder(complex_, Angle(bound, triangulation()));
    run_limited(exuder, visitor);
}

void Mesher::optimize(const TetMesherOptimization& what, const Progress& progress) {
    using Sizing = CGAL::Mesh_3::Mesh_sizing_field<Triangulation>;
    watch_.begin(1, progress);
    watch_.check(0);
    if (what.lloyd) smooth<CGAL::Mesh_3::Lloyd_move<Complex, Sizing>>(Visitor(watch_, 0.1, 0.1));
    if (what.odt) smooth<CGAL::Mesh_3::Odt_move<Complex, Sizing>>(Visitor(watch_, 0.2, 0.2));
    if (what.perturb) perturb(what.sliver_bound_deg, Visitor(watch_, 0.3, 0.6));
    if (what.exude) exude(what.sliver_bound_deg, Visitor(watch_, 0.6, 1));
    watch_.step(1);
}

TetMesh Mesher::mesh() const {
    TetMesh out;
    const Triangulation& t = complex_.triangulation();
    for (auto v = t.finite_vertices_begin(); v != t.finite_vertices_end(); ++v) v->set_meshing_info(-1);
    for (auto c = complex_.cells_in_complex_begin(); c != complex_.cells_in_complex_end(); ++c) {
        Tetrahedron tet;
        for (int k = 0; k < 4; ++k) {
            const Vertex v = c->vertex(k);
            if (v->meshing_info() < 0) {
                v->set_meshing_info(static_cast<double>(out.points.size()));
                out.points.push_back(vec(v->point()));
            }
            tet[static_cast<std::size_t>(k)] = static_cast<VertexId>(v->meshing_info());
        }
        out.tets.push_back(tet);
        out.regions.push_back(complex_.subdomain_index(c));
    }
    return out;
}

}  // namespace

#ifdef VDBGEO_PARALLEL_TET_MESHER
std::unique_ptr<TetMesher> make_parallel_tet_mesher(const TetDomain& domain, const TetMesherBounds& bounds) {
    return std::make_unique<Mesher>(domain, bounds);
}
#else
bool have_tet_mesher() { return true; }
std::unique_ptr<TetMesher> make_tet_mesher(const TetDomain& domain, const TetMesherBounds& bounds) {
    return std::make_unique<Mesher>(domain, bounds);
}
#endif

}  // namespace vdbgeo

#else  // without CGAL

namespace vdbgeo {

#ifdef VDBGEO_PARALLEL_TET_MESHER
std::unique_ptr<TetMesher> make_parallel_tet_mesher(const TetDomain&, const TetMesherBounds&) {
    throw InvalidInput("Delaunay tetrahedra need CGAL, which this build does not have");
}
#else
bool have_tet_mesher() { return false; }
std::unique_ptr<TetMesher> make_tet_mesher(const TetDomain&, const TetMesherBounds&) {
    throw InvalidInput("Delaunay tetrahedra need CGAL, which this build does not have");
}
#endif

}  // namespace vdbgeo

#endif
