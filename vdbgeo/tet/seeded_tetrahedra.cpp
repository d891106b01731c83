#include "vdbgeo/tet/seeded_tetrahedra.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/space_hash.h"

namespace vdbgeo {

/// By halving. A domain is piecewise constant: nothing else tells where its regions end.
TetDomain::Crossing TetDomain::crossing(const Vec3d& a, std::int32_t ra, const Vec3d& b,
                                        std::int32_t rb) const {
    Vec3d from = a, to = b;
    std::array<std::int32_t, 2> regions = {ra, rb};
    for (int step = 0; step < 200 && (to - from).squaredNorm() > tolerance_ * tolerance_; ++step) {
        const Vec3d middle = 0.5 * (from + to);
        const std::int32_t r = region(middle);
        if (r == regions[0]) {
            from = middle;
        } else {
            to = middle;
            regions[1] = r;
        }
    }
    return {0.5 * (from + to), regions};
}

namespace {

constexpr int max_rounds = 4;
constexpr double seed_spacing = 1.2;   // in facet sizes
constexpr double lost_within = 1.8;    // distances between seeds
constexpr double part_spacing = 0.14;  // in diagonals of a small part

/// splitmix64's finaliser, as a number from 0 to 1.
double scatter(std::uint64_t n) {
    n = (n + 1) * 0x9E3779B97F4A7C15ull;
    n = (n ^ n >> 30) * 0xBF58476D1CE4E5B9ull;
    n = (n ^ n >> 27) * 0x94D049BB133111EBull;
    return static_cast<double>((n ^ n >> 31) >> 11) * 0x1p-53;
}

class Seeder {
 public:
    Seeder(const TetDomain& domain, const ReferenceBoundary& reference, const TetMesherBounds& bounds)
        : domain_(domain),
          reference_(reference),
          bounds_(bounds),
          hash_(lost_within * seed_spacing * bounds.facet_size) {
        measure_parts();
    }

    /// Seeds on the whole boundary.
    std::vector<BoundarySeed> first() {
        for (std::size_t t = 0; t < reference_.triangles.size(); ++t)
            sample(corner(t, 0), corner(t, 1), corner(t, 2), reference_.part[t], 24);
        return seeds_;
    }

    /// Seeds around those of the last round that are lost, twice as densely.
    std::vector<BoundarySeed> around(const std::vector<char>& met) {
        const std::size_t last = seeds_.size() - fresh_;
        fresh_ = 0;
        fraction_ /= 2;
        SpaceHash spots(1.5 * seed_spacing * bounds_.facet_size);
        std::size_t unmet = 0;
        for (std::size_t s = last; s < met.size(); ++s)
            if (lost(met, s)) {
                spots.add(seeds_[s].place, static_cast<std::uint32_t>(s));
                ++unmet;
            }
        if (unmet == 0) return {};
        for (std::size_t t = 0; t < reference_.triangles.size(); ++t) {
            const Vec3d centre = (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3;
            const double size = 0.6 * longest(t);
            if (spots.near(centre, [&](std::uint32_t s) {
                    return (seeds_[s].place - centre).norm() < 1.5 * spacing_[s] + size;
                }))
                sample(corner(t, 0), corner(t, 1), corner(t, 2), reference_.part[t], 24);
        }
        return {seeds_.end() - static_cast<std::ptrdiff_t>(fresh_), seeds_.end()};
    }

    /// How many vertices the mesh may have in the end.
    double expected_vertices() const {
        double volume = 0, area = 0;
        for (std::size_t t = 0; t < reference_.triangles.size(); ++t) {
            const Vec3d n = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
            volume += n.dot(corner(t, 0) - reference_.points[0]) / 6;
            area += n.norm() / 2;
        }
        const double c = bounds_.cell_size, f = bounds_.facet_size;
        return std::abs(volume) / (c * c * c) + area / (f * f);
    }

 private:
    const Vec3d& corner(std::size_t t, std::size_t k) const {
        return reference_.points[reference_.triangles[t][k]];
    }
    double longest(std::size_t t) const {
        return std::max({(corner(t, 0) - corner(t, 1)).norm(), (corner(t, 1) - corner(t, 2)).norm(),
                         (corner(t, 2) - corner(t, 0)).norm()});
    }

    void measure_parts() {
        std::uint32_t parts = 0;
        for (const std::uint32_t p : reference_.part) parts = std::max(parts, p + 1);
        std::vector<Vec3d> low(parts, Vec3d::Constant(std::numeric_limits<double>::infinity())),
            high(parts, Vec3d::Constant(-std::numeric_limits<double>::infinity()));
        for (std::size_t t = 0; t < reference_.triangles.size(); ++t)
            for (std::size_t k = 0; k < 3; ++k) {
                const std::uint32_t p = reference_.part[t];
                low[p] = low[p].cwiseMin(corner(t, k));
                high[p] = high[p].cwiseMax(corner(t, k));
            }
        for (std::uint32_t p = 0; p < parts; ++p) part_size_.push_back((high[p] - low[p]).norm());
    }

    double spacing(std::uint32_t part, const Vec3d& p) const {
        const double size = bounds_.facet_size * (bounds_.graded ? bounds_.graded(p)[0] : 1);
        return std::min(seed_spacing * size, part_spacing * part_size_[part]);
    }

    /// A seed that was not met, nor was any around it. Single ones are left alone: they stand at the tips of
    /// spikes.
    bool lost(const std::vector<char>& met, std::size_t s) const {
        if (met[s]) return false;
        const double near = lost_within * spacing_[s];
        return !hash_.near(seeds_[s].place, [&](std::uint32_t n) {
            return n < met.size() && met[n] && part_of_[n] == part_of_[s] &&
                   (seeds_[n].place - seeds_[s].place).squaredNorm() < near * near;
        });
    }

    /// Splits a triangle until its parts are smaller than the distance of the seeds, and offers a place in
    /// each.
    void sample(const Vec3d& a, const Vec3d& b, const Vec3d& c, std::uint32_t part, int depth) {
        const std::array<const Vec3d*, 3> at = {&a, &b, &c};
        std::size_t k = 0;
        const auto length = [&](std::size_t e) { return (*at[e] - *at[(e + 1) % 3]).norm(); };
        for (std::size_t e = 1; e < 3; ++e)
            if (length(e) > length(k)) k = e;
        const double wanted = fraction_ * spacing(part, (a + b + c) / 3);
        if (depth > 0 && length(k) > 0.75 * wanted) {
            const Vec3d &u = *at[k], &v = *at[(k + 1) % 3], &w = *at[(k + 2) % 3], m = 0.5 * (u + v);
            sample(u, m, w, part, depth - 1);
            sample(m, v, w, part, depth - 1);
            return;
        }
        offer(a, b, c, part, wanted);
    }

    /// The places are scattered: on a lattice many would lie on one sphere.
    void offer(const Vec3d& a, const Vec3d& b, const Vec3d& c, std::uint32_t part, double wanted) {
        const double s = 0.1 + 0.4 * scatter(2 * offered_), t = 0.1 + 0.4 * scatter(2 * offered_ + 1);
        ++offered_;
        const Vec3d place = a + s * (b - a) + t * (c - a);
        const auto taken = [&](const Vec3d& p) {
            return hash_.near(p, [&](std::uint32_t n) {
                return part_of_[n] == part && (seeds_[n].place - p).squaredNorm() < wanted * wanted;
            });
        };
        if (taken(place)) return;
        const Vec3d normal = (b - a).cross(c - a).normalized();
        if (!normal.allFinite()) return;
        const std::optional<BoundarySeed> seed = project(place, normal, part);
        if (!seed || taken(seed->place)) return;
        if (seeds_.size() >= bounds_.max_vertices)
            throw NumericalError(fmt::format("sizes that small need more than {} vertices: try larger sizes",
                                             bounds_.max_vertices));
        hash_.add(seed->place, static_cast<std::uint32_t>(seeds_.size()));
        seeds_.push_back(*seed);
        part_of_.push_back(part);
        spacing_.push_back(wanted);
        ++fresh_;
    }

    std::optional<BoundarySeed> project(const Vec3d& place, const Vec3d& normal, std::uint32_t part) const {
        for (double r = std::min(0.05 * reference_.reach, 0.1 * part_size_[part]); r < 4 * reference_.reach;
             r *= 4) {
            const double step = std::min(r, reference_.reach);
            const Vec3d in = place - step * normal, out = place + step * normal;
            const std::int32_t a = domain_.region(in), b = domain_.region(out);
            if (a != b) return domain_.crossing(in, a, out, b);
        }
        return {};
    }

    const TetDomain& domain_;
    const ReferenceBoundary& reference_;
    const TetMesherBounds& bounds_;
    std::vector<double> part_size_;
    SpaceHash hash_;
    std::vector<BoundarySeed> seeds_;
    std::size_t fresh_ = 0;  // the last of them, of this round
    double fraction_ = 1;    // of the usual distance
    std::vector<std::uint32_t> part_of_;
    std::vector<double> spacing_;
    std::uint64_t offered_ = 0;
};

/// Twenty bits of each coordinate, one after another.
std::uint64_t z_curve(const Vec3d& p, const Vec3d& low, double scale) {
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) {
        auto x = static_cast<std::uint64_t>(std::clamp((p[a] - low[a]) * scale, 0.0, 1048575.0));
        x = (x | x << 32) & 0x1F00000000FFFFull;
        x = (x | x << 16) & 0x1F0000FF0000FFull;
        x = (x | x << 8) & 0x100F00F00F00F00Full;
        x = (x | x << 4) & 0x10C30C30C30C30C3ull;
        x = (x | x << 2) & 0x1249249249249249ull;
        key |= x << a;
    }
    return key;
}

/// Tetrahedra along a Z curve, points in the order in which the tetrahedra name them.
TetMesh in_order(const TetMesh& mesh, const Vec3d& low, const Vec3d& high) {
    const std::size_t n = mesh.tets.size();
    const double scale = 1048576 / std::max((high - low).maxCoeff(), 1e-300);
    Array<std::pair<std::uint64_t, std::uint32_t>> order(n);
    parallel_for(n, 4096, [&](std::size_t t) {
        Vec3d centre = Vec3d::Zero();
        for (const VertexId v : mesh.tets[t]) centre += mesh.points[v] / 4;
        order[t] = {z_curve(centre, low, scale), static_cast<std::uint32_t>(t)};
    });
    std::sort(order.begin(), order.end());
    TetMesh out;
    constexpr VertexId unset = 0xFFFFFFFFu;
    std::vector<VertexId> number(mesh.points.size(), unset);
    const bool regions =
        std::any_of(mesh.regions.begin(), mesh.regions.end(), [](std::int32_t r) { return r != 1; });
    for (const auto& [key, t] : order) {
        Tetrahedron tet = mesh.tets[t];
        for (VertexId& v : tet) {
            if (number[v] == unset) {
                number[v] = static_cast<VertexId>(out.points.size());
                out.points.push_back(mesh.points[v]);
            }
            v = number[v];
        }
        out.tets.push_back(tet);
        if (regions) out.regions.push_back(mesh.regions[t]);
    }
    return out;
}

std::size_t count_flat(const TetMesh& mesh) {
    std::size_t flat = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) flat += !(tet_determinant(mesh, t) > 0);
    return flat;
}

/// CGAL's tetrahedra are positive in exact numbers, but four seeds on a circle can make one that is flat in
/// floating-point ones.
TetMesh sound_mesh(TetMesher& mesher, const Progress& progress) {
    TetMesh mesh = mesher.mesh();
    if (count_flat(mesh) == 0) return mesh;
    TetMesherOptimization least;
    least.perturb = least.exude = true;
    least.sliver_bound_deg = 0.1;
    mesher.optimize(least, progress);
    mesh = mesher.mesh();
    if (const std::size_t flat = count_flat(mesh); flat > 0)
        throw NumericalError(
            fmt::format("{} tetrahedra without volume are left: try the optimisers perturb and exude", flat));
    return mesh;
}

}  // namespace

std::vector<std::uint32_t> connected_parts(std::size_t points, const Array<Triangle>& triangles) {
    std::vector<std::uint32_t> parent(points), number(points, 0xFFFFFFFFu), part;
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
    std::uint32_t count = 0;
    for (const Triangle& t : triangles) {
        std::uint32_t& n = number[root(t[0])];
        if (n == 0xFFFFFFFFu) n = count++;
        part.push_back(n);
    }
    return part;
}

TetMesh seeded_tetrahedra(const TetDomain& domain, const ReferenceBoundary& reference,
                          const SeededTetOptions& options, const Progress& progress) {
    const TetMesherBounds& bounds = options.bounds;
    Seeder seeder(domain, reference, bounds);
    std::vector<BoundarySeed> seeds = seeder.first();
    if (seeds.empty()) throw NumericalError("there is no boundary to fill with tetrahedra");
    const auto mesher =
        options.parallel ? make_parallel_tet_mesher(domain, bounds) : make_tet_mesher(domain, bounds);
    const TetMesherOptimization& more = options.optimization;
    const bool optimize = more.lloyd || more.odt || more.perturb || more.exude;
    const double refined = optimize ? 0.2 : 0.95, expected = seeder.expected_vertices();
    progress.report(0.02);
    for (int round = 0; round < max_rounds && !seeds.empty(); ++round) {
        mesher->insert(seeds);
        mesher->refine(TetMesher::Extent::boundary, expected,
                       progress.part((0.1 + 0.1 * round) * refined, (0.2 + 0.1 * round) * refined));
        seeds = seeder.around(mesher->seeds_met());
    }
    mesher->refine(TetMesher::Extent::everything, expected, progress.part(0.5 * refined, refined));
    if (optimize) mesher->optimize(more, progress.part(refined, 0.95));
    TetMesh mesh = in_order(sound_mesh(*mesher, progress.part(0.95, 0.97)), bounds.low, bounds.high);
    set_faces(mesh);
    progress.report(1);
    return mesh;
}

}  // namespace vdbgeo
