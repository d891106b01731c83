#include "vdbgeo/surface/delaunay_mesher.h"

#include "vdbgeo/core/errors.h"

#ifdef VDBGEO_HAS_CGAL

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Exact_rational.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Spatial_sort_traits_adapter_3.h>
#include <CGAL/Triangulation_cell_base_with_info_3.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>
#include <CGAL/spatial_sort.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <queue>

namespace vdbgeo {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Clock = std::chrono::steady_clock;

Vec3d vec(const Point& p) { return {p.x(), p.y(), p.z()}; }
Point point(const Vec3d& p) { return {p.x(), p.y(), p.z()}; }

/// A tetrahedron is in the solid where its circumcentre is.
struct CellInfo {
    Vec3d centre;
    double level = -std::numeric_limits<double>::infinity();
    std::uint32_t id = 0;
    std::array<std::uint32_t, 4> version{};  // of what is known of its facets
    bool inside() const { return level >= 0; }
};
struct VertexInfo {
    std::uint32_t seed = DelaunayMesh::no_seed;
    std::uint32_t number = 0;
};

using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<VertexInfo, Kernel>;
using CellBase = CGAL::Triangulation_cell_base_with_info_3<CellInfo, Kernel,
                                                           CGAL::Delaunay_triangulation_cell_base_3<Kernel>>;
using Triangulation =
    CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;
using Cell = Triangulation::Cell_handle;
using Vertex = Triangulation::Vertex_handle;
using Facet = Triangulation::Facet;

Vec3d exact_circumcentre(const std::array<Vec3d, 4>& p) {
    using Exact = CGAL::Simple_cartesian<CGAL::Exact_rational>;
    const auto at = [&](std::size_t k) { return Exact::Point_3(p[k].x(), p[k].y(), p[k].z()); };
    if (CGAL::coplanar(at(0), at(1), at(2), at(3)))
        return Vec3d::Constant(std::numeric_limits<double>::infinity());
    const Exact::Point_3 c = CGAL::circumcenter(at(0), at(1), at(2), at(3));
    return {CGAL::to_double(c.x()), CGAL::to_double(c.y()), CGAL::to_double(c.z())};
}

Vec3d circumcentre(const std::array<Vec3d, 4>& p) {
    const Vec3d u = p[1] - p[0], v = p[2] - p[0], w = p[3] - p[0];
    const Vec3d vw = v.cross(w), wu = w.cross(u), uv = u.cross(v);
    const double det = u.dot(vw), size = std::max({u.squaredNorm(), v.squaredNorm(), w.squaredNorm()});
    // The error of det is some 1e-15 · size^1.5; six digits are enough.
    if (!(std::abs(det) > 1e-9 * size * std::sqrt(size))) return exact_circumcentre(p);
    return p[0] + (u.squaredNorm() * vw + v.squaredNorm() * wu + w.squaredNorm() * uv) / (2 * det);
}

/// A facet on the surface that breaks a bound. The worst of the first bound broken comes first.
struct BadFacet {
    double key;
    std::uint64_t order;
    Vec3d centre;  // of its surface ball
    std::uint32_t cell, generation, version;
    int index;
    bool operator<(const BadFacet& other) const {  // the queue gives the largest first
        return key != other.key ? key > other.key : order > other.order;
    }
};

}  // namespace

class DelaunayMesher::Impl {
 public:
    Impl(const Solid& solid, const Vec3d& low, const Vec3d& high, const DelaunayBounds& bounds)
        : solid_(solid), low_(low), high_(high), bounds_(bounds), tolerance_(1e-5 * bounds.radius) {
        const double s = std::sin(std::min(60.0, bounds.angle_deg) * M_PI / 180);
        sine_squared_ = s * s;
    }

    void refine(const std::vector<Vec3d>& seeds, double expected, const Progress& progress) {
        progress_ = progress;
        expected_ = std::max(expected, 1.0);
        if (triangulation_.dimension() < 3) {
            insert_first(seeds);
        } else {
            for (std::size_t i = 0; i < seeds.size(); ++i)
                add_seed(seeds[i], first_seed_ + static_cast<std::uint32_t>(i));
        }
        first_seed_ += static_cast<std::uint32_t>(seeds.size());
        if (triangulation_.dimension() < 3) return;
        do empty_queue();
        while (refine_singular());
    }

    DelaunayMesh surface() const {
        DelaunayMesh mesh;
        for_each_facet([&](const Facet& f) {
            Triangle t;
            for (int k = 0; k < 3; ++k) {
                const Vertex v = corner(f, k);
                std::uint32_t& number = v->info().number;
                if (number >= mesh.points.size() || mesh.points[number] != vec(v->point())) {
                    number = static_cast<std::uint32_t>(mesh.points.size());
                    mesh.points.push_back(vec(v->point()));
                    mesh.seed.push_back(v->info().seed);
                }
                t[static_cast<std::size_t>(k)] = number;
            }
            mesh.triangles.push_back(t);
        });
        return mesh;
    }

 private:
    struct Slot {
        Cell cell;
        std::uint32_t generation = 0;
    };

    double level(const Vec3d& p) const {
        for (int a = 0; a < 3; ++a)
            if (!(p[a] >= low_[a] && p[a] <= high_[a])) return -std::numeric_limits<double>::infinity();
        return solid_(p);
    }

    void tick() {
        if ((++ticks_ & 0xFF) != 0) return;
        const double vertices = static_cast<double>(triangulation_.number_of_vertices());
        if (Clock::now() > bounds_.deadline)
            throw NumericalError(
                fmt::format("Delaunay refinement did not end within {:g} s, at {} vertices: try a larger "
                            "radius, a smaller angle, or allow more time",
                            bounds_.max_seconds, vertices));
        const double part = vertices / expected_;
        reported_ = std::max(reported_, part < 0.5 ? part : 1 - 0.25 / part);  // never quite 1
        progress_.report(reported_);
    }
    void check_vertices() const {
        if (triangulation_.number_of_vertices() >= bounds_.max_vertices)
            throw NumericalError(
                fmt::format("Delaunay refinement reached the bound of {} vertices: try a larger radius, a "
                            "smaller angle, or allow more vertices",
                            bounds_.max_vertices));
    }

    /// Where the surface parts a (inside) from b: regula falsi in the Illinois form, halving where a value is
    /// infinite or too little is gained.
    Vec3d cross(Vec3d a, Vec3d b, double u, double v) const {
        int last = 0;
        for (int step = 0; step < 400; ++step) {
            const double length = (b - a).norm();
            if (!(length > tolerance_)) break;
            double t = u / (u - v);
            if (!std::isfinite(u) || !std::isfinite(v) || !std::isfinite(t) || step % 4 == 3) t = 0.5;
            const double margin = std::min(0.5, 0.5 * tolerance_ / length);
            t = std::min(1 - margin, std::max(margin, t));
            const Vec3d m = a + t * (b - a);
            const double w = level(m);
            if (w == 0) return m;
            if (w > 0) {
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
        return 0.5 * (a + b);
    }

    /// The centre of the surface ball of a facet, told from its cell inside.
    Vec3d surface_centre(const Facet& f) const {
        const Cell in = f.first, out = in->neighbor(f.second);
        const CellInfo &a = in->info(), &b = out->info();
        if (!triangulation_.is_infinite(out)) return cross(a.centre, b.centre, a.level, b.level);
        const auto p = corners(f);
        const Vec3d along = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
        const double reach = (high_ - low_).norm();  // the cell's circumcentre is in the box
        return cross(a.centre, a.centre + reach * along, a.level, -std::numeric_limits<double>::infinity());
    }

    /// The facet's corners, counter-clockwise seen from outside its cell.
    static Vertex corner(const Facet& f, int k) {
        return f.first->vertex(Triangulation::vertex_triple_index(f.second, 2 - k));
    }
    static std::array<Vec3d, 3> corners(const Facet& f) {
        return {vec(corner(f, 0)->point()), vec(corner(f, 1)->point()), vec(corner(f, 2)->point())};
    }

    /// Which bound the facet breaks (0 size, 1 distance, 2 angle) and how badly: 0…1, 0 worst.
    std::optional<double> fault(const Facet& f, const Vec3d& centre) const {
        const auto p = corners(f);
        const double local = bounds_.local_radius ? bounds_.local_radius(centre) : bounds_.radius;
        const double ball = (p[0] - centre).squaredNorm(), radius = local * local;
        if (ball > radius) return radius / ball;
        const double least = std::min(bounds_.smallest, 0.01 * local);
        if (ball < least * least) return {};
        const Vec3d u = p[1] - p[0], v = p[2] - p[0], n = u.cross(v);
        const double area = n.squaredNorm();  // (2·area)²
        const double uu = u.squaredNorm(), vv = v.squaredNorm(), ww = (u - v).squaredNorm();
        const Vec3d circum = p[0] + (uu * v.cross(n) + vv * n.cross(u)) / (2 * area);
        const double off = (circum - centre).squaredNorm();
        const double allowed = bounds_.distance * (local / bounds_.radius);
        if (!(off <= allowed * allowed)) return 1 + std::min(0.999, allowed * allowed / off);
        // sin² of the least angle = (2·area)² · the shortest side² / product of the sides²
        const double sine = area * std::min({uu, vv, ww}) / (uu * vv * ww);
        if (!(sine >= sine_squared_)) return 2 + sine;
        return {};
    }

    void set_up(Cell c) {
        CellInfo& info = c->info();
        if (!free_.empty()) {
            info.id = free_.back();
            free_.pop_back();
        } else {
            info.id = static_cast<std::uint32_t>(slots_.size());
            slots_.emplace_back();
        }
        slots_[info.id].cell = c;
        info.version = {};
        info.level = -std::numeric_limits<double>::infinity();
        if (triangulation_.is_infinite(c)) return;
        info.centre = circumcentre({vec(c->vertex(0)->point()), vec(c->vertex(1)->point()),
                                    vec(c->vertex(2)->point()), vec(c->vertex(3)->point())});
        info.level = level(info.centre);
    }
    void forget(Cell c) {
        Slot& slot = slots_[c->info().id];
        slot.cell = Cell();
        ++slot.generation;
        free_.push_back(c->info().id);
    }

    /// Looks at the facet between a cell and a neighbour, and queues it where it breaks a bound.
    void look(Cell c, int i) {
        const Cell n = c->neighbor(i);
        const bool inside = c->info().inside();
        if (inside == n->info().inside()) {
            return;
        }
        const Facet f = inside ? Facet(c, i) : Facet(n, n->index(c));
        const Vec3d centre = surface_centre(f);
        const auto key = fault(f, centre);
        if (!key) return;
        CellInfo& info = f.first->info();
        queue_.push({*key, order_++, centre, info.id, slots_[info.id].generation,
                     info.version[static_cast<std::size_t>(f.second)], f.second});
    }

    void insert_first(const std::vector<Vec3d>& seeds) {
        std::vector<Point> points;
        points.reserve(seeds.size());
        for (const Vec3d& s : seeds) points.push_back(point(s));
        std::vector<std::ptrdiff_t> order(points.size());
        std::iota(order.begin(), order.end(), std::ptrdiff_t{0});
        using Places = CGAL::Spatial_sort_traits_adapter_3<Kernel, const Point*>;
        CGAL::spatial_sort(order.begin(), order.end(), Places(points.data()));
        Cell near;
        for (const std::ptrdiff_t i : order) {
            tick();
            check_vertices();
            const Vertex v = triangulation_.insert(points[static_cast<std::size_t>(i)], near);
            if (v->info().seed == DelaunayMesh::no_seed)
                v->info().seed = first_seed_ + static_cast<std::uint32_t>(i);
            near = v->cell();
        }
        if (triangulation_.dimension() < 3) return;
        for (auto c = triangulation_.all_cells_begin(); c != triangulation_.all_cells_end(); ++c) {
            tick();
            set_up(c);
        }
        // (CGAL's order of the facets follows the cells' addresses.)
        for_each_facet([this](const Facet& f) { look(f.first, f.second); });
        hint_ = triangulation_.finite_vertices_begin()->cell();
    }

    /// A seed near a vertex would make a triangle that is too small to be refined: the vertex takes its
    /// number.
    void add_seed(const Vec3d& place, std::uint32_t seed) {
        const Vertex v = triangulation_.nearest_vertex(point(place), hint_);
        const double spacing = 0.3 * (bounds_.local_radius ? bounds_.local_radius(place) : bounds_.radius);
        if ((vec(v->point()) - place).squaredNorm() > spacing * spacing)
            insert(place, v->cell(), seed);
        else if (v->info().seed == DelaunayMesh::no_seed)
            v->info().seed = seed;
    }

    /// False where there is a vertex at the place already.
    bool insert(const Vec3d& place, Cell near, std::uint32_t seed) {
        tick();
        check_vertices();
        const Point p = point(place);
        Triangulation::Locate_type type;
        int i, j;
        const Cell start = triangulation_.locate(p, type, i, j, near);
        if (type == Triangulation::VERTEX) return false;
        hole_.clear();
        rim_.clear();
        triangulation_.find_conflicts(p, start, std::back_inserter(rim_), std::back_inserter(hole_));
        for (const Cell c : hole_) forget(c);
        // What was known of the facets around the hole is out of date.
        for (const Facet& f : rim_) {
            const Facet other = triangulation_.mirror_facet(f);
            const bool first_in_hole = slots_[f.first->info().id].cell != f.first;
            const Facet& stays = first_in_hole ? other : f;
            ++stays.first->info().version[static_cast<std::size_t>(stays.second)];
        }
        const Facet entry = in_hole(rim_.front()) ? rim_.front() : triangulation_.mirror_facet(rim_.front());
        const Vertex v =
            triangulation_.insert_in_hole(p, hole_.begin(), hole_.end(), entry.first, entry.second);
        v->info().seed = seed;
        star_.clear();
        triangulation_.incident_cells(v, std::back_inserter(star_));
        for (const Cell c : star_) set_up(c);
        for (const Cell c : star_)
            for (int k = 0; k < 4; ++k) {
                if (triangulation_.is_infinite(c, k)) continue;
                const Cell n = c->neighbor(k);
                // Facets between two cells of the star are seen from one of them.
                if (c->vertex(k) == v || c->info().id < n->info().id) look(c, k);
            }
        hint_ = v->cell();
        return true;
    }
    bool in_hole(const Facet& f) const { return slots_[f.first->info().id].cell != f.first; }

    void empty_queue() {
        while (!queue_.empty()) {
            const BadFacet bad = queue_.top();
            queue_.pop();
            const Slot& slot = slots_[bad.cell];
            if (slot.generation != bad.generation || slot.cell == Cell() ||
                slot.cell->info().version[static_cast<std::size_t>(bad.index)] != bad.version)
                continue;
            insert(bad.centre, slot.cell, DelaunayMesh::no_seed);
        }
    }

    /// Calls visit(facet told from its cell inside) for all facets on the surface.
    template <class Visit>
    void for_each_facet(const Visit& visit) const {
        if (triangulation_.dimension() < 3) return;
        for (auto c = triangulation_.finite_cells_begin(); c != triangulation_.finite_cells_end(); ++c) {
            if (!c->info().inside()) continue;
            for (int i = 0; i < 4; ++i)
                if (!c->neighbor(i)->info().inside()) visit(Facet(c, i));
        }
    }

    bool refine_singular();

    const Solid& solid_;
    const Vec3d low_, high_;
    const DelaunayBounds bounds_;
    const double tolerance_;
    double sine_squared_;
    Progress progress_;
    double expected_ = 1, reported_ = 0;
    std::uint64_t ticks_ = 0, order_ = 0;
    std::uint32_t first_seed_ = 0;
    Triangulation triangulation_;
    std::vector<Slot> slots_;
    std::vector<std::uint32_t> free_;
    std::priority_queue<BadFacet> queue_;
    Cell hint_;
    std::vector<Cell> hole_, star_;
    std::vector<Facet> rim_;
};

/// Inserts the centre of the largest surface ball at every edge that has not two facets and every vertex
/// whose facets are not one disc. Whether there was one to insert.
bool DelaunayMesher::Impl::refine_singular() {
    std::vector<Facet> facets;
    std::vector<Vertex> vertices;
    struct Side {
        std::uint64_t ends;
        std::uint32_t facet;
        bool operator<(const Side& o) const { return ends != o.ends ? ends < o.ends : facet < o.facet; }
    };
    std::vector<Side> sides;
    for_each_facet([&](const Facet& f) {
        std::array<std::uint64_t, 3> id;
        for (int k = 0; k < 3; ++k) {
            const Vertex v = corner(f, k);
            std::uint32_t& number = v->info().number;
            if (number >= vertices.size() || vertices[number] != v) {
                number = static_cast<std::uint32_t>(vertices.size());
                vertices.push_back(v);
            }
            id[static_cast<std::size_t>(k)] = number;
        }
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint64_t a = id[k], b = id[(k + 1) % 3];
            sides.push_back(
                {std::min(a, b) << 32 | std::max(a, b), static_cast<std::uint32_t>(facets.size())});
        }
        facets.push_back(f);
    });
    std::sort(sides.begin(), sides.end());
    // The corners of the facets, joined across the edges of two facets: one class a vertex is one disc.
    std::vector<std::uint32_t> parent(3 * facets.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t c) {
        while (parent[c] != c) c = parent[c] = parent[parent[c]];
        return c;
    };
    const auto corner_at = [&](std::uint32_t f, std::uint64_t vertex) {
        std::uint32_t k = 0;
        while (corner(facets[f], static_cast<int>(k))->info().number != vertex) ++k;
        return 3 * f + k;
    };
    std::vector<char> bad(vertices.size(), 0);
    for (std::size_t i = 0; i < sides.size();) {
        std::size_t j = i;
        while (j < sides.size() && sides[j].ends == sides[i].ends) ++j;
        const std::uint64_t a = sides[i].ends >> 32, b = sides[i].ends & 0xFFFFFFFF;
        if (j - i == 2) {
            for (const std::uint64_t v : {a, b}) {
                const std::uint32_t p = root(corner_at(sides[i].facet, v)),
                                    q = root(corner_at(sides[i + 1].facet, v));
                parent[std::max(p, q)] = std::min(p, q);
            }
        } else {
            bad[a] = bad[b] = 1;
        }
        i = j;
    }
    std::vector<std::uint32_t> disc(vertices.size(), 0xFFFFFFFF);
    for (std::uint32_t f = 0; f < facets.size(); ++f)
        for (std::uint32_t k = 0; k < 3; ++k) {
            const std::uint32_t v = corner(facets[f], static_cast<int>(k))->info().number;
            const std::uint32_t r = root(3 * f + k);
            if (disc[v] == 0xFFFFFFFF) disc[v] = r;
            if (disc[v] != r) bad[v] = 1;
        }
    // The largest ball at each bad vertex.
    std::vector<double> size(vertices.size(), 0);
    std::vector<Vec3d> place(vertices.size());
    for (const Facet& f : facets) {
        std::optional<Vec3d> centre;
        for (int k = 0; k < 3; ++k) {
            const Vertex v = corner(f, k);
            const std::uint32_t n = v->info().number;
            if (!bad[n]) continue;
            if (!centre) centre = surface_centre(f);
            const double ball = (vec(v->point()) - *centre).squaredNorm();
            if (ball > size[n]) {
                size[n] = ball;
                place[n] = *centre;
            }
        }
    }
    // Far below the smallest ball only where nothing else is left.
    bool any = false;
    for (const double least : {bounds_.smallest, 0.01 * bounds_.smallest}) {
        for (std::size_t n = 0; n < vertices.size(); ++n)
            if (bad[n] && size[n] > least * least &&
                insert(place[n], vertices[n]->cell(), DelaunayMesh::no_seed))
                any = true;
        if (any) break;
    }
    return any;
}

bool have_delaunay_mesher() { return true; }

DelaunayMesher::DelaunayMesher(const Solid& solid, const Vec3d& low, const Vec3d& high,
                               const DelaunayBounds& bounds)
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
