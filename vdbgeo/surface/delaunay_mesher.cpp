#include "vdbgeo/surface/delaunay_mesher.h"

#include "vdbgeo/core/errors.h"

#ifdef VDBGEO_HAS_CGAL

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Random.h>
#include <CGAL/refine_mesh_3.h>
#include <CGAL/spatial_sort.h>
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <unordered_map>

namespace vdbgeo {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Clock = std::chrono::steady_clock;

Vec3d vec(const Point& p) { return {p.x(), p.y(), p.z()}; }
Point point(const Vec3d& p) { return {p.x(), p.y(), p.z()}; }

/// What the queries of a run share: when to stop, and how far it is.
struct Watch {
    std::function<std::size_t()> vertices;
    Clock::time_point deadline;
    double max_seconds = 0, expected = 1;
    Progress progress;
    std::uint64_t queries = 0;
    double reported = 0;

    void tick() {
        if ((++queries & 0xFFF) != 0) return;
        if (Clock::now() > deadline)
            throw NumericalError(fmt::format("Delaunay refinement did not end within {:g} s, at {} vertices: try a larger "
                                             "radius, a smaller angle, or allow more time",
                                             max_seconds, vertices()));
        const double part = static_cast<double>(vertices()) / expected;
        reported = std::max(reported, part < 0.5 ? part : 1 - 0.25 / part);  // never quite 1
        progress.report(reported);
    }
};

/// The solid as Mesh_3 wants to see it: one subdomain, one surface patch, both numbered 1.
class Domain {
 public:
    using R = Kernel;
    using FT = double;
    using Point_3 = Kernel::Point_3;
    using Vector_3 = Kernel::Vector_3;
    using Segment_3 = Kernel::Segment_3;
    using Ray_3 = Kernel::Ray_3;
    using Line_3 = Kernel::Line_3;
    using Subdomain_index = int;
    using Surface_patch_index = int;
    using Index = int;
    using Subdomain = boost::optional<int>;
    using Surface_patch = boost::optional<int>;
    using Intersection = std::tuple<Point_3, Index, int>;
    using Has_features = CGAL::Tag_false;

    Domain(const Solid& solid, const Vec3d& low, const Vec3d& high, double tolerance, Watch& watch)
        : solid_(solid), low_(low), high_(high), tolerance_(tolerance), watch_(watch) {}

    double level(const Vec3d& p) const {
        for (int a = 0; a < 3; ++a)
            if (!(p[a] >= low_[a] && p[a] <= high_[a])) return -std::numeric_limits<double>::infinity();
        return solid_(p);
    }

    struct Is_in_domain {
        const Domain& domain;
        Subdomain operator()(const Point_3& p) const {
            return domain.level(vec(p)) >= 0 ? Subdomain(1) : Subdomain();
        }
    };
    Is_in_domain is_in_domain_object() const { return {*this}; }

    struct Construct_intersection {
        const Domain& domain;
        Intersection operator()(const Segment_3& s) const { return domain.cross(vec(s.source()), vec(s.target())); }
        /// The far end of a ray is outside.
        Intersection operator()(const Ray_3& ray) const {
            const Vec3d from = vec(ray.source());
            const Vec3d along = vec(ray.second_point()) - from;
            const double length = along.norm();
            const double reach = (domain.high_ - domain.low_).norm() + (from - domain.low_).norm();
            if (!(length > 0) || !std::isfinite(reach)) return {};
            return domain.cross(from, from + along * (reach / length));
        }
        Intersection operator()(const Line_3&) const { return {}; }
    };
    Construct_intersection construct_intersection_object() const { return {*this}; }

    Index index_from_surface_patch_index(int patch) const { return patch; }
    Index index_from_subdomain_index(int subdomain) const { return subdomain; }
    Surface_patch_index surface_patch_index(int index) const { return index; }
    Subdomain_index subdomain_index(int index) const { return index; }
    CGAL::Bbox_3 bbox() const { return {low_.x(), low_.y(), low_.z(), high_.x(), high_.y(), high_.z()}; }

    /// Where the surface parts a from b: regula falsi in the Illinois form, halving where a value is infinite
    /// or too little is gained.
    Intersection cross(Vec3d a, Vec3d b) const {
        watch_.tick();
        double u = level(a), v = level(b);
        if ((u >= 0) == (v >= 0)) return {};
        int last = 0;
        for (int step = 0; step < 200; ++step) {
            const double length = (b - a).norm();
            if (!(length > tolerance_)) break;
            double t = u / (u - v);
            if (!std::isfinite(t) || step % 4 == 3) t = 0.5;
            const double margin = std::min(0.5, 0.5 * tolerance_ / length);
            t = std::min(1 - margin, std::max(margin, t));
            const Vec3d m = a + t * (b - a);
            const double w = level(m);
            if (w == 0) {
                a = b = m;
                break;
            }
            if ((w >= 0) == (u >= 0)) {
                a = m;
                u = w;
                if (last == 1) v /= 2;
                last = 1;
            } else {
                b = m;
                v = w;
                if (last == 2) u /= 2;
                last = 2;
            }
        }
        return {point(0.5 * (a + b)), 1, 2};
    }

 private:
    const Solid& solid_;
    const Vec3d low_, high_;
    const double tolerance_;
    Watch& watch_;
};

using Triangulation = CGAL::Mesh_triangulation_3<Domain>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;

/// The bounds, as facets are tested for them: size first, then distance, shapes last.
class FacetCriteria {
 public:
    using Facet_quality = std::pair<int, double>;
    using Is_facet_bad = boost::optional<Facet_quality>;
    using Has_manifold_criterion = CGAL::Tag_true;

    explicit FacetCriteria(const DelaunayBounds& bounds) : bounds_(&bounds) {
        const double s = std::sin(std::min(60.0, bounds.angle_deg) * M_PI / 180);
        sine_squared_ = s * s;
    }

    CGAL::Mesh_facet_topology topology() const { return CGAL::FACET_VERTICES_ON_SURFACE; }

    Is_facet_bad operator()(const Triangulation&, const Triangulation::Facet& f) const {
        std::array<Vec3d, 3> p;
        for (std::size_t k = 0; k < 3; ++k)
            p[k] = vec(f.first->vertex((f.second + 1 + static_cast<int>(k)) & 3)->point().point());
        const Vec3d centre = vec(f.first->get_facet_surface_center(f.second));
        const double local = bounds_->local_radius ? bounds_->local_radius(centre) : bounds_->radius;
        const double ball = (p[0] - centre).squaredNorm(), radius = local * local;
        if (ball > radius) return Facet_quality(0, radius / ball);
        const double least = std::min(bounds_->smallest, 0.1 * local);
        if (ball < least * least) return boost::none;

        const Vec3d u = p[1] - p[0], v = p[2] - p[0], n = u.cross(v);
        const double area = n.squaredNorm();  // (2·area)²
        const double uu = u.squaredNorm(), vv = v.squaredNorm(), ww = (u - v).squaredNorm();
        const Vec3d circum = p[0] + (uu * v.cross(n) + vv * n.cross(u)) / (2 * area);
        const double off = (circum - centre).squaredNorm();
        const double allowed = bounds_->distance * (local / bounds_->radius);
        if (!(off <= allowed * allowed)) return Facet_quality(1, allowed * allowed / off);
        // sin² of the least angle = (2·area)² · the shortest side² / product of the sides²
        const double sine = area * std::min({uu, vv, ww}) / (uu * vv * ww);
        if (!(sine >= sine_squared_)) return Facet_quality(2, sine);
        return boost::none;
    }

 private:
    const DelaunayBounds* bounds_;
    double sine_squared_;
};

/// Nothing is asked of the tetrahedra.
struct CellCriteria {
    using Cell_quality = double;
    using Is_cell_bad = boost::optional<Cell_quality>;
    Is_cell_bad operator()(const Triangulation&, const Triangulation::Cell_handle&) const { return boost::none; }
};

struct Criteria {
    using Facet_criteria = FacetCriteria;
    using Cell_criteria = CellCriteria;
    FacetCriteria facets;
    const FacetCriteria& facet_criteria_object() const { return facets; }
    CellCriteria cell_criteria_object() const { return {}; }
};

}  // namespace

class DelaunayMesher::Impl {
 public:
    Impl(const Solid& solid, const Vec3d& low, const Vec3d& high, const DelaunayBounds& bounds)
        : bounds_(bounds), domain_(solid, low, high, 1e-5 * bounds.radius, watch_) {
        watch_.deadline = bounds.deadline;
        watch_.max_seconds = bounds.max_seconds;
        watch_.vertices = [this] { return complex_.triangulation().number_of_vertices(); };
    }

    void refine(const std::vector<Vec3d>& seeds, double expected, const Progress& progress) {
        watch_.progress = progress;
        watch_.expected = std::max(expected, 1.0);
        CGAL::get_default_random() = CGAL::Random(0);
        insert(seeds);
        const Criteria criteria{FacetCriteria(bounds_)};
        CGAL::Mesh_error_code error = CGAL::CGAL_MESH_3_NO_ERROR;
        namespace p = CGAL::parameters;
        p::internal::Mesh_3_options options;
        options.maximal_number_of_vertices = bounds_.max_vertices;
        options.pointer_to_error_code = &error;
        CGAL::refine_mesh_3(complex_, domain_, criteria, p::no_exude(), p::no_perturb(), p::no_reset_c3t3(), options,
                            p::manifold());
        if (error == CGAL::CGAL_MESH_3_MAXIMAL_NUMBER_OF_VERTICES_REACHED)
            throw NumericalError(fmt::format("Delaunay refinement reached the bound of {} vertices: try a larger radius, a "
                                             "smaller angle, or allow more vertices",
                                             bounds_.max_vertices));
    }

    DelaunayMesh surface() const {
        DelaunayMesh mesh;
        std::unordered_map<const void*, VertexId> number;
        const auto id = [&](Triangulation::Vertex_handle v) {
            const auto [it, fresh] = number.try_emplace(&*v, static_cast<VertexId>(mesh.points.size()));
            if (fresh) {
                mesh.points.push_back(vec(v->point().point()));
                const auto seed = seed_.find(&*v);
                mesh.seed.push_back(seed == seed_.end() ? DelaunayMesh::no_seed : seed->second);
            }
            return it->second;
        };
        for (auto f = complex_.facets_in_complex_begin(); f != complex_.facets_in_complex_end(); ++f) {
            const bool inside = complex_.is_in_complex(f->first);
            Triangle t;
            for (int k = 0; k < 3; ++k)
                t[static_cast<std::size_t>(k)] =
                    id(f->first->vertex(Triangulation::vertex_triple_index(f->second, k)));
            // vertex_triple_index lists a facet counter-clockwise seen from its cell's inner side.
            if (inside) std::swap(t[1], t[2]);
            mesh.triangles.push_back(t);
        }
        return mesh;
    }

 private:
    void insert(const std::vector<Vec3d>& seeds) {
        std::vector<Point> points;
        points.reserve(seeds.size());
        for (const Vec3d& s : seeds) points.push_back(point(s));
        std::vector<std::ptrdiff_t> order(points.size());
        std::iota(order.begin(), order.end(), std::ptrdiff_t{0});
        using Places = CGAL::Spatial_sort_traits_adapter_3<Kernel, const Point*>;
        CGAL::spatial_sort(order.begin(), order.end(), Places(points.data()));
        auto& triangulation = complex_.triangulation();
        Triangulation::Vertex_handle hint;
        for (const std::ptrdiff_t i : order) {
            watch_.tick();
            const Triangulation::Weighted_point p(points[static_cast<std::size_t>(i)]);
            const auto v = hint == Triangulation::Vertex_handle() ? triangulation.insert(p)
                                                                  : triangulation.insert(p, hint->cell());
            if (v == Triangulation::Vertex_handle()) continue;  // a second seed at the same place
            hint = v;
            complex_.set_dimension(v, 2);
            complex_.set_index(v, 1);
            seed_.try_emplace(&*v, next_seed_ + static_cast<std::uint32_t>(i));
        }
        next_seed_ += static_cast<std::uint32_t>(seeds.size());
    }

    const DelaunayBounds bounds_;
    Watch watch_;
    Domain domain_;
    Complex complex_;
    std::unordered_map<const void*, std::uint32_t> seed_;
    std::uint32_t next_seed_ = 0;
};

bool have_delaunay_mesher() { return true; }

DelaunayMesher::DelaunayMesher(const Solid& solid, const Vec3d& low, const Vec3d& high, const DelaunayBounds& bounds)
    : impl_(std::make_unique<Impl>(solid, low, high, bounds)) {}
DelaunayMesher::~DelaunayMesher() = default;
void DelaunayMesher::refine(const std::vector<Vec3d>& seeds, double expected, const Progress& progress) {
    impl_->refine(seeds, expected, progress);
}
DelaunayMesh DelaunayMesher::surface() const { return impl_->surface(); }

}  // namespace vdbgeo

#else

namespace vdbgeo {

class DelaunayMesher::Impl {};

bool have_delaunay_mesher() { return false; }

DelaunayMesher::DelaunayMesher(const Solid&, const Vec3d&, const Vec3d&, const DelaunayBounds&) {
    throw InvalidInput("Delaunay meshing needs CGAL, which this build does not have");
}
DelaunayMesher::~DelaunayMesher() = default;
void DelaunayMesher::refine(const std::vector<Vec3d>&, double, const Progress&) {}
DelaunayMesh DelaunayMesher::surface() const { return {}; }

}  // namespace vdbgeo

#endif
