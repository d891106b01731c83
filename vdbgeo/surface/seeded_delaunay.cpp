#include "vdbgeo/surface/seeded_delaunay.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/space_hash.h"

namespace vdbgeo {
namespace {

constexpr int max_rounds = 5;
constexpr double thinnest = 1.0 / 64;     // in radius bounds, that is followed
constexpr std::size_t max_thin = 200000;  // points a round
constexpr double seed_spacing = 1.2;      // in radius bounds
constexpr double small_to_copy = 8;       // in radius bounds: diagonal of a component
constexpr double small_component = 0.15;  // its radius bound, in its diagonals

/// The component of each point, numbered in the order of the points; unused points get numbers of their own
/// after all others.
struct Components {
    std::vector<std::uint32_t> of_point;
    std::uint32_t count = 0;
};

template <class Triangles>
Components components_of(std::size_t points, const Triangles& triangles) {
    std::vector<std::uint32_t> parent(points);
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const Triangle& t : triangles)
        for (std::size_t k = 1; k < 3; ++k) {
            const std::uint32_t a = root(t[0]), b = root(t[k]);
            parent[std::max(a, b)] = std::min(a, b);
        }
    std::vector<bool> used(points, false);
    for (const Triangle& t : triangles)
        for (const VertexId v : t) used[v] = true;
    Components out;
    out.of_point.resize(points);
    for (const bool want : {true, false}) {
        for (std::uint32_t v = 0; v < points; ++v)
            if (used[v] == want) {
                const std::uint32_t r = root(v);
                out.of_point[v] = r == v ? out.count++ : out.of_point[r];
            }
        if (want) {
            // Unused points are numbered too, but not counted.
            const std::uint32_t count = out.count;
            for (std::uint32_t v = 0, next = count; v < points; ++v)
                if (!used[v]) out.of_point[v] = next++;
            return out;
        }
    }
    return out;
}

class SeededRun {
 public:
    SeededRun(const Solid& solid, const Vec3d& low, const Vec3d& high, const ReferenceMesh& reference,
              const SeededBounds& bounds, const Progress& progress)
        : solid_(solid),
          reference_(reference),
          bounds_(bounds),
          progress_(progress),
          parts_(components_of(reference.points.size(), reference.triangles)),
          fine_(bounds.radius),
          mesher_(solid, low, high, delaunay_bounds()) {
        measure_components();
    }

    DelaunayMesh run();

 private:
    struct Part {
        Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
        Vec3d high = -low;
        double radius = 0;  // bound
        bool open = false;
    };
    struct Spot {
        Vec3d place;
        double radius;
    };
    struct ThinPoint {
        Vec3d place, normal;
        std::uint32_t part;
    };
    struct Faults {
        std::uint64_t missing = 0, joined = 0, parted = 0, fragments = 0;
        std::vector<Vec3d> thin_places;  // where the surface is joined, parted or not covered
        std::vector<VertexId> uncovered;
        std::vector<char> is_missing;  // per component of the reference
        bool components_differ() const { return missing + joined + parted + fragments > 0; }
    };

    DelaunayBounds delaunay_bounds() {
        DelaunayBounds out;
        out.angle_deg = bounds_.angle_deg;
        out.radius = bounds_.radius;
        out.distance = bounds_.distance;
        out.smallest = bounds_.radius / 16384;
        out.max_vertices = bounds_.max_vertices;
        out.max_seconds = bounds_.max_seconds;
        out.deadline = std::chrono::steady_clock::now() +
                       std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                           std::chrono::duration<double>(bounds_.max_seconds));
        out.local_radius = [this](const Vec3d& p) { return local_radius(p); };
        return out;
    }

    /// The bound at a place: it grows by a radius a radius away from the spots.
    double local_radius(const Vec3d& p) const {
        double radius = bounds_.radius;
        if (spots_.empty()) return radius;
        fine_.near(p, [&](std::uint32_t n) {
            const Spot& spot = spots_[n];
            const double room = radius - spot.radius;
            const double d = (spot.place - p).squaredNorm();
            if (room > 0 && d < room * room) radius = spot.radius + std::sqrt(d);
            return false;
        });
        return radius;
    }
    void add_spot(const Vec3d& place, double radius) {
        if (local_radius(place) < 1.25 * radius) return;
        fine_.add(place, static_cast<std::uint32_t>(spots_.size()));
        spots_.push_back({place, radius});
    }

    void measure_components();
    void find_open_components();
    std::optional<Vec3d> on_surface(const Vec3d& centre, const Vec3d& normal, double size) const;
    std::vector<Vec3d> make_seeds();
    Faults compare(const DelaunayMesh& mesh, bool places) const;
    void add_uncovered(const DelaunayMesh& mesh, Faults& faults) const;
    double thickness(const Vec3d& p, const Vec3d& normal, double least) const;
    void follow_thickness(const Vec3d& a, const Vec3d& b, const Vec3d& c, std::uint32_t part, int depth);
    std::vector<Vec3d> densify(const Faults& faults);
    double expected_vertices() const;
    DelaunayMesh mended(const DelaunayMesh& mesh) const;

    const Solid& solid_;
    const ReferenceMesh& reference_;
    const SeededBounds bounds_;
    const Progress& progress_;
    const Components parts_;
    std::vector<Part> part_;
    std::vector<std::uint32_t> seed_part_;  // of every seed so far; an extra seed has none
    SpaceHash fine_;
    std::vector<Spot> spots_;
    std::vector<ThinPoint> thin_;
    DelaunayMesher mesher_;
};

void SeededRun::measure_components() {
    part_.resize(parts_.count);
    for (const Triangle& t : reference_.triangles)
        for (const VertexId v : t) {
            Part& part = part_[parts_.of_point[v]];
            part.low = part.low.cwiseMin(reference_.points[v]);
            part.high = part.high.cwiseMax(reference_.points[v]);
        }
    for (Part& part : part_)
        part.radius = std::min(bounds_.radius, small_component * (part.high - part.low).norm());
    find_open_components();
    std::vector<char> marked(reference_.points.size(), 0);
    for (const Triangle& t : reference_.triangles)
        for (const VertexId v : t) {
            const Part& part = part_[parts_.of_point[v]];
            if (part.radius >= bounds_.radius || marked[v]) continue;
            marked[v] = 1;
            if (spots_.size() % 4096 == 0) progress_.report(0);
            add_spot(reference_.points[v], part.radius);
        }
}

void SeededRun::find_open_components() {
    std::vector<std::uint64_t> sides;
    sides.reserve(3 * reference_.triangles.size());
    for (const Triangle& t : reference_.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint64_t a = t[k], b = t[(k + 1) % 3];
            sides.push_back(std::min(a, b) << 32 | std::max(a, b));
        }
    std::sort(sides.begin(), sides.end());
    for (std::size_t i = 0; i < sides.size();) {
        std::size_t j = i;
        while (j < sides.size() && sides[j] == sides[i]) ++j;
        if (j - i == 1) part_[parts_.of_point[sides[i] >> 32]].open = true;
        i = j;
    }
}

/// The point of the surface on the normal through a face's centre, where there is one within half a radius
/// bound. (Corners of faces lie on the lattice's edges, many in one plane: bad for exact predicates.) `size`
/// is the face's.
std::optional<Vec3d> SeededRun::on_surface(const Vec3d& centre, const Vec3d& normal, double size) const {
    const bool inside = solid_(centre) >= 0;
    const Vec3d out = inside ? normal : Vec3d(-normal);
    const double limit = std::max(0.6 * bounds_.radius, size);
    double near = 0, far = 0;
    for (double reach = std::min(size, bounds_.radius) / 64; reach < limit; reach *= 1.5) {
        if ((solid_(centre + reach * out) >= 0) != inside) {
            far = reach;
            break;
        }
        near = reach;
    }
    if (far == 0) return {};
    for (int step = 0; step < 30 && far - near > 1e-5 * far; ++step) {
        const double middle = 0.5 * (near + far);
        ((solid_(centre + middle * out) >= 0) == inside ? near : far) = middle;
    }
    return centre + 0.5 * (near + far) * out;
}

/// Seeds on the faces, none nearer than the spacing to another of the same component that
/// faces the same way.
std::vector<Vec3d> SeededRun::make_seeds() {
    struct Seed {
        Vec3d place, normal;
        std::uint32_t part;
    };
    std::vector<Seed> seeds;
    SpaceHash hash(seed_spacing * bounds_.radius);
    std::size_t looked_at = 0;
    for (const Triangle& t : reference_.triangles) {
        if (looked_at++ % 4096 == 0) progress_.report(0);  // dust makes millions of seeds
        if (seeds.size() > bounds_.max_vertices)
            throw NumericalError(fmt::format(
                "the surface needs more than {} vertices to begin with: drop dust, or allow more vertices",
                bounds_.max_vertices));
        const Vec3d &a = reference_.points[t[0]], &b = reference_.points[t[1]], &c = reference_.points[t[2]];
        const std::uint32_t part = parts_.of_point[t[0]];
        const Vec3d centre = (a + b + c) / 3;
        const bool small = part_[part].radius < bounds_.radius;
        const double spacing =
            (small ? 0.5 : 1) * seed_spacing * std::min(part_[part].radius, local_radius(centre));
        const Vec3d normal = (b - a).cross(c - a).normalized();
        if (!normal.allFinite()) continue;
        const bool taken = hash.near(centre, [&](std::uint32_t n) {
            const Seed& s = seeds[n];
            return s.part == part && (s.place - centre).squaredNorm() < spacing * spacing &&
                   s.normal.dot(normal) > 0;
        });
        if (taken) continue;
        const Vec3d place = on_surface(centre, normal, std::sqrt((b - a).cross(c - a).norm())).value_or(a);
        hash.add(place, static_cast<std::uint32_t>(seeds.size()));
        seeds.push_back({place, normal, part});
    }
    std::vector<Vec3d> places;
    for (const Seed& s : seeds) {
        places.push_back(s.place);
        seed_part_.push_back(s.part);
    }
    return places;
}

/// Which components of the reference are not there, joined or parted; with `places`, where.
SeededRun::Faults SeededRun::compare(const DelaunayMesh& mesh, bool places) const {
    Faults faults;
    faults.is_missing.assign(parts_.count, 0);
    const Components got = components_of(mesh.points.size(), mesh.triangles);
    // Through the seeds, a bipartite graph between the components here and there.
    std::vector<std::vector<std::uint32_t>> there(parts_.count), here(got.count);
    std::vector<char> known(got.count, 0);  // has a seed
    const auto note = [](std::vector<std::uint32_t>& list, std::uint32_t n) {
        if (std::find(list.begin(), list.end(), n) == list.end()) list.push_back(n);
    };
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        if (mesh.seed[v] == DelaunayMesh::no_seed) continue;
        const std::uint32_t part = seed_part_[mesh.seed[v]];
        known[got.of_point[v]] = 1;
        if (part == DelaunayMesh::no_seed) continue;
        note(there[part], got.of_point[v]);
        note(here[got.of_point[v]], part);
    }
    std::vector<char> parted(parts_.count, 0), joined(got.count, 0);
    for (std::uint32_t p = 0; p < parts_.count; ++p) {
        if (there[p].empty()) {
            ++faults.missing;
            faults.is_missing[p] = 1;
        } else if (there[p].size() > 1) {
            ++faults.parted;
            parted[p] = 1;
        }
    }
    for (std::uint32_t g = 0; g < got.count; ++g) {
        faults.fragments += known[g] ? 0 : 1;
        if (here[g].size() < 2) continue;
        const auto closed =
            std::count_if(here[g].begin(), here[g].end(), [&](std::uint32_t p) { return !part_[p].open; });
        if (closed == 0) continue;
        ++faults.joined;
        joined[g] = 1;
    }
    if (!places || !faults.components_differ()) return faults;

    const double reach = bounds_.radius;
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        if (!known[got.of_point[v]]) faults.thin_places.push_back(mesh.points[v]);
    SpaceHash vertices(reach), points(reach);
    for (std::uint32_t v = 0; v < mesh.points.size(); ++v) vertices.add(mesh.points[v], v);
    const auto nearest = [&](const SpaceHash& hash, const Vec3d& p, const auto& at, const auto& of,
                             const auto& among) {
        double best = std::numeric_limits<double>::infinity();
        std::uint32_t label = DelaunayMesh::no_seed;
        hash.near(p, [&](std::uint32_t n) {
            const double d = (at[n] - p).squaredNorm();
            if (d < best && std::find(among.begin(), among.end(), of[n]) != among.end()) {
                best = d;
                label = of[n];
            }
            return false;
        });
        return label;
    };
    const bool any_joined = std::count(joined.begin(), joined.end(), 1) > 0;
    std::vector<std::uint32_t> label(reference_.points.size(), DelaunayMesh::no_seed);
    std::vector<char> seen(reference_.points.size(), 0);
    for (const Triangle& t : reference_.triangles)
        for (const VertexId v : t) {
            if (seen[v]) continue;
            seen[v] = 1;
            const std::uint32_t p = parts_.of_point[v];
            if (any_joined) points.add(reference_.points[v], v);
            if (parted[p])
                label[v] = nearest(vertices, reference_.points[v], mesh.points, got.of_point, there[p]);
        }
    for (const Triangle& t : reference_.triangles)
        if (parted[parts_.of_point[t[0]]] && (label[t[0]] != label[t[1]] || label[t[0]] != label[t[2]]))
            faults.thin_places.push_back(reference_.points[t[0]]);
    if (!any_joined) return faults;
    label.assign(mesh.points.size(), DelaunayMesh::no_seed);
    for (std::uint32_t v = 0; v < mesh.points.size(); ++v) {
        const std::uint32_t g = got.of_point[v];
        if (joined[g])
            label[v] = nearest(points, mesh.points[v], reference_.points, parts_.of_point, here[g]);
    }
    for (const Triangle& t : mesh.triangles)
        if (joined[got.of_point[t[0]]] && (label[t[0]] != label[t[1]] || label[t[0]] != label[t[2]]))
            faults.thin_places.push_back(mesh.points[t[0]]);
    return faults;
}

/// Vertices of the reference that nothing of the mesh is near to.
void SeededRun::add_uncovered(const DelaunayMesh& mesh, Faults& faults) const {
    const double reach = bounds_.radius;
    SpaceHash vertices(reach);
    for (std::uint32_t v = 0; v < mesh.points.size(); ++v) vertices.add(mesh.points[v], v);
    for (VertexId v = 0; v < reference_.points.size(); ++v) {
        const Vec3d& p = reference_.points[v];
        if (vertices.near(
                p, [&](std::uint32_t n) { return (mesh.points[n] - p).squaredNorm() <= reach * reach; }))
            continue;
        faults.thin_places.push_back(p);
        faults.uncovered.push_back(v);
    }
}

/// How thick the solid, or the gap outside, is at a point of its surface; nothing where that is more than a
/// radius.
double SeededRun::thickness(const Vec3d& p, const Vec3d& normal, double least) const {
    for (double s = 0.5 * least; s < bounds_.radius; s *= 1.3)
        if (solid_(p - s * normal) < 0 || solid_(p + s * normal) >= 0) return s;
    return bounds_.radius;
}

/// The bound follows the thickness over a face, which is split until its parts are as small as the bound
/// asks.
void SeededRun::follow_thickness(const Vec3d& a, const Vec3d& b, const Vec3d& c, std::uint32_t part,
                                 int depth) {
    double least = thinnest * bounds_.radius;
    if (part_[part].radius < bounds_.radius) least = std::min(least, 0.15 * part_[part].radius);
    const Vec3d flat = (b - a).cross(c - a).normalized(), centre = (a + b + c) / 3;
    if (!flat.allFinite() || thin_.size() > max_thin) return;
    std::optional<Vec3d> found = on_surface(centre, flat, std::sqrt((b - a).cross(c - a).norm()));
    if (found && (*found - centre).norm() > 0.25 * bounds_.radius) found.reset();  // another sheet, maybe
    const Vec3d p = found.value_or(centre);
    const double h = 1e-3 * least;
    Vec3d normal = -Vec3d(solid_(p + h * Vec3d::UnitX()) - solid_(p - h * Vec3d::UnitX()),
                          solid_(p + h * Vec3d::UnitY()) - solid_(p - h * Vec3d::UnitY()),
                          solid_(p + h * Vec3d::UnitZ()) - solid_(p - h * Vec3d::UnitZ()))
                        .normalized();
    if (!normal.allFinite()) normal = flat;
    const double size = found ? std::max(least, 0.5 * thickness(p, normal, least)) : bounds_.radius / 8;
    if (found && size < 0.3 * bounds_.radius) {
        add_spot(p, size);
        thin_.push_back({p, normal, part});
    }
    const std::array<const Vec3d*, 3> at = {&a, &b, &c};
    std::size_t longest = 0;
    const auto length = [&](std::size_t k) { return (*at[k] - *at[(k + 1) % 3]).norm(); };
    for (std::size_t k = 1; k < 3; ++k)
        if (length(k) > length(longest)) longest = k;
    if (depth == 0 || length(longest) < 1.5 * size) return;
    const Vec3d &u = *at[longest], &v = *at[(longest + 1) % 3], &w = *at[(longest + 2) % 3],
                m = 0.5 * (u + v);
    follow_thickness(u, m, w, part, depth - 1);
    follow_thickness(m, v, w, part, depth - 1);
}

/// Lowers the radius bound on missing components and around the thin places to a part of the thickness there,
/// and seeds them as densely.
std::vector<Vec3d> SeededRun::densify(const Faults& faults) {
    const double reach = 0.7 * bounds_.radius;
    SpaceHash hash(reach);
    for (std::uint32_t i = 0; i < faults.thin_places.size(); ++i) hash.add(faults.thin_places[i], i);
    const auto thin = [&](const Vec3d& p) {
        return hash.near(
            p, [&](std::uint32_t n) { return (faults.thin_places[n] - p).squaredNorm() < reach * reach; });
    };
    thin_.clear();
    for (const Triangle& t : reference_.triangles) {
        const Vec3d &a = reference_.points[t[0]], &b = reference_.points[t[1]], &c = reference_.points[t[2]];
        const std::uint32_t part = parts_.of_point[t[0]];
        if (faults.is_missing[part])
            follow_thickness(a, b, c, part, 11);
        else if (thin((a + b + c) / 3))
            follow_thickness(a, b, c, part, 11);
    }
    std::vector<Vec3d> seeds;
    for (const VertexId v : faults.uncovered) {
        const Vec3d& p = reference_.points[v];
        add_spot(p, std::max(0.5 * local_radius(p), 2 * thinnest * bounds_.radius));
        seeds.push_back(p);
        seed_part_.push_back(parts_.of_point[v]);
    }
    SpaceHash taken(bounds_.radius);
    for (std::uint32_t i = 0; i < thin_.size(); ++i) {
        const ThinPoint& point = thin_[i];
        const double spacing = 0.8 * seed_spacing * local_radius(point.place);
        if (taken.near(point.place, [&](std::uint32_t n) {
                return (thin_[n].place - point.place).squaredNorm() < spacing * spacing &&
                       thin_[n].normal.dot(point.normal) > 0;
            }))
            continue;
        taken.add(point.place, i);
        seeds.push_back(point.place);
        seed_part_.push_back(point.part);
    }
    return seeds;
}

/// From the area: what is left where the facets' radius is the bound.
double SeededRun::expected_vertices() const {
    double vertices = 0;
    for (const Triangle& t : reference_.triangles) {
        const Vec3d &a = reference_.points[t[0]], &b = reference_.points[t[1]], &c = reference_.points[t[2]];
        const double radius = std::min(part_[parts_.of_point[t[0]]].radius, bounds_.radius);
        vertices += 0.5 * (b - a).cross(c - a).norm() / (radius * radius);
    }
    return vertices;
}

/// Where refinement ended with other components than the reference: those of the reference that are missing,
/// and small ones that are joined or parted, are taken from the reference as they are.
DelaunayMesh SeededRun::mended(const DelaunayMesh& mesh) const {
    const Components got = components_of(mesh.points.size(), mesh.triangles);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> links;  // component of the reference, component here
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        if (mesh.seed[v] == DelaunayMesh::no_seed) continue;
        const std::uint32_t part = seed_part_[mesh.seed[v]];
        if (part != DelaunayMesh::no_seed) links.emplace_back(part, got.of_point[v]);
    }
    std::sort(links.begin(), links.end());
    links.erase(std::unique(links.begin(), links.end()), links.end());
    // Clusters of components that are linked: numbers from parts_.count on are components here.
    std::vector<std::uint32_t> parent(parts_.count + got.count), left(parent.size()), right(parent.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t n) {
        while (parent[n] != n) n = parent[n] = parent[parent[n]];
        return n;
    };
    for (const auto& [p, g] : links) {
        const std::uint32_t a = root(p), b = root(parts_.count + g);
        parent[std::max(a, b)] = std::min(a, b);
    }
    std::vector<char> large(parent.size(), 0);
    for (std::uint32_t p = 0; p < parts_.count; ++p) {
        ++left[root(p)];
        const double size = (part_[p].high - part_[p].low).norm();
        if (part_[p].open || size > small_to_copy * bounds_.radius) large[root(p)] = 1;
    }
    for (std::uint32_t g = 0; g < got.count; ++g) ++right[root(parts_.count + g)];
    const auto copied = [&](std::uint32_t n) {
        const std::uint32_t r = root(n);
        const bool missing = left[r] == 1 && right[r] == 0 && !part_[r].open;
        return missing || (left[r] > 0 && !large[r] && !(left[r] == 1 && right[r] == 1));
    };
    DelaunayMesh out;
    const auto add = [&](const auto& points, const auto& triangles, const auto& wanted) {
        std::vector<std::uint32_t> number(points.size(), DelaunayMesh::no_seed);
        for (Triangle t : triangles) {
            if (!wanted(t[0])) continue;
            for (VertexId& v : t) {
                if (number[v] == DelaunayMesh::no_seed) {
                    number[v] = static_cast<std::uint32_t>(out.points.size());
                    out.points.push_back(points[v]);
                    out.seed.push_back(DelaunayMesh::no_seed);
                }
                v = number[v];
            }
            out.triangles.push_back(t);
        }
    };
    add(mesh.points, mesh.triangles, [&](VertexId v) { return !copied(parts_.count + got.of_point[v]); });
    add(reference_.points, reference_.triangles, [&](VertexId v) { return copied(parts_.of_point[v]); });
    return out;
}

DelaunayMesh SeededRun::run() {
    std::vector<Vec3d> seeds = make_seeds();
    for (const Vec3d& p : reference_.extra_seeds) {
        seeds.push_back(p);
        seed_part_.push_back(DelaunayMesh::no_seed);
    }
    const double expected = expected_vertices();
    for (int round = 0;; ++round) {
        mesher_.refine(seeds, expected, progress_.part(round == 0 ? 0 : 0.9, round == 0 ? 0.9 : 1));
        DelaunayMesh mesh = mesher_.surface();
        const bool last = round + 1 == max_rounds;
        Faults faults = compare(mesh, !last);
        if (!last) {
            add_uncovered(mesh, faults);
            if (faults.missing > 0 || !faults.thin_places.empty()) {
                seeds = densify(faults);
                continue;
            }
        }
        return faults.components_differ() ? mended(mesh) : mesh;
    }
}

}  // namespace

DelaunayMesh seeded_delaunay(const Solid& solid, const Vec3d& low, const Vec3d& high,
                             const ReferenceMesh& reference, const SeededBounds& bounds,
                             const Progress& progress) {
    return SeededRun(solid, low, high, reference, bounds, progress).run();
}

}  // namespace vdbgeo
