#include "vdbgeo/tet/tet_store.h"

#include <fmt/format.h>

#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/tet_adjacency.h"

namespace vdbgeo {
namespace {

constexpr std::size_t block = 8192;

bool has(const Tetrahedron& t, VertexId v) { return t[0] == v || t[1] == v || t[2] == v || t[3] == v; }

/// The triangle turned so that its corner c is first.
Triangle turned(const Triangle& t, std::size_t c) { return {t[c], t[(c + 1) % 3], t[(c + 2) % 3]}; }

void refuse_turned_over(const TetMesh& mesh) {
    struct Found {
        std::uint64_t count = 0;
        std::size_t first = 0;
    };
    const auto part = [&](std::size_t begin, std::size_t end) {
        Found found;
        for (std::size_t t = begin; t < end; ++t)
            if (tet_determinant(mesh, t) < 0 && found.count++ == 0) found.first = t;
        return found;
    };
    const auto join = [](Found& sum, const Found& more) {
        if (sum.count == 0) sum.first = more.first;
        sum.count += more.count;
    };
    const Found found = fixed_order_reduce(mesh.tets.size(), block, Found{}, part, join);
    if (found.count > 0)
        throw InvalidInput(fmt::format("optimize: {} tetrahedra are turned over, number {} for one",
                                       found.count, found.first));
}

}  // namespace

TetStore::TetStore(const TetMesh& mesh, const DihedralBounds& bounds, bool surface_moves)
    : bounds_(bounds),
      points_(mesh.points),
      tets_(mesh.tets),
      regions_(mesh.regions),
      worth_(mesh.tets.size()),
      freedom_(mesh.points.size()),
      stars_(mesh.points.size()),
      pool_(4 * mesh.tets.size()),
      changed_(mesh.points.size()) {
    refuse_turned_over(mesh);
    parallel_for(tets_.size(), block, [&](std::size_t t) { worth_[t] = worth_of(tets_[t]); });

    std::fill(stars_.begin(), stars_.end(), Star{0, 0, 0});
    for (const Tetrahedron& t : tets_)
        for (const VertexId v : t) ++stars_[v].capacity;
    std::uint64_t begin = 0;
    for (Star& star : stars_) {
        star.begin = begin;
        begin += star.capacity;
    }
    for (std::size_t t = 0; t < tets_.size(); ++t)
        for (const VertexId v : tets_[t])
            pool_[stars_[v].begin + stars_[v].count++] = static_cast<std::uint32_t>(t);
    set_boundary(mesh, surface_moves);
}

/// What the boundary and the faces between regions allow. Flips keep both, so this holds for good.
void TetStore::set_boundary(const TetMesh& mesh, bool surface_moves) {
    const TetAdjacency adjacency = tet_adjacency(mesh);
    std::fill(freedom_.begin(), freedom_.end(), VertexFreedom::free);
    fan_start_.assign(points_.size() + 1, 0);
    std::vector<Triangle> boundary;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (std::size_t k = 0; k < 4; ++k) {
            const std::uint32_t n = adjacency.neighbour[t][k];
            if (n != TetAdjacency::none && mesh.region(n) == mesh.region(t)) continue;
            Triangle face{};
            for (std::size_t c = 0; c < 3; ++c)
                face[c] = mesh.tets[t][static_cast<std::size_t>(tet_faces[k][c])];
            if (n == TetAdjacency::none) boundary.push_back(face);
            for (const VertexId v : face) {
                const bool slides =
                    n == TetAdjacency::none && surface_moves && freedom_[v] != VertexFreedom::fixed;
                freedom_[v] = slides ? VertexFreedom::surface : VertexFreedom::fixed;
            }
        }
    // Regions may meet at a vertex or an edge alone.
    parallel_for(points_.size(), block, [&](std::size_t v) {
        const TetSpan around = star(static_cast<VertexId>(v));
        for (const std::uint32_t t : around)
            if (region(t) != region(*around.begin())) freedom_[v] = VertexFreedom::fixed;
    });
    for (const Triangle& face : boundary)
        for (const VertexId v : face) ++fan_start_[v + std::size_t{1}];
    for (std::size_t v = 0; v < points_.size(); ++v) fan_start_[v + 1] += fan_start_[v];
    fans_.resize(3 * boundary.size());
    Array<std::uint64_t> next(fan_start_);
    for (const Triangle& face : boundary)
        for (std::size_t c = 0; c < 3; ++c) fans_[next[face[c]]++] = turned(face, c);
}

std::uint32_t TetStore::across(std::uint32_t t, std::size_t k) const {
    const auto& corners = tet_faces[k];
    const VertexId a = tets_[t][static_cast<std::size_t>(corners[0])],
                   b = tets_[t][static_cast<std::size_t>(corners[1])],
                   c = tets_[t][static_cast<std::size_t>(corners[2])];
    for (const std::uint32_t other : star(a))
        if (other != t && has(tets_[other], b) && has(tets_[other], c)) return other;
    return static_cast<std::uint32_t>(slot_count());
}

bool TetStore::share_tet(VertexId a, VertexId b) const {
    for (const std::uint32_t t : star(a))
        if (has(tets_[t], b)) return true;
    return false;
}

std::vector<std::uint32_t> TetStore::worse_than(double goal) const {
    using List = std::vector<std::uint32_t>;
    const auto part = [&](std::size_t begin, std::size_t end) {
        List found;
        for (std::size_t t = begin; t < end; ++t)
            if (worth_[t] < goal) found.push_back(static_cast<std::uint32_t>(t));
        return found;
    };
    const auto join = [](List& all, const List& more) { all.insert(all.end(), more.begin(), more.end()); };
    return fixed_order_reduce(worth_.size(), block, List{}, part, join);
}

void TetStore::move(VertexId v, const Vec3d& to, std::uint32_t epoch) {
    points_[v] = to;
    for (const std::uint32_t t : star(v)) {
        worth_[t] = worth_of(tets_[t]);
        for (const VertexId w : tets_[t]) mark(w, epoch);
    }
}

void TetStore::replace(const std::vector<std::uint32_t>& old, const std::vector<Tetrahedron>& fresh,
                       std::uint32_t epoch) {
    const std::int32_t shared_region = region(old[0]);
    for (const std::uint32_t t : old) {
        for (const VertexId v : tets_[t]) {
            take_from_star(v, t);
            mark(v, epoch);
        }
        worth_[t] = std::numeric_limits<double>::infinity();
    }
    dead_.insert(dead_.end(), old.rbegin(), old.rend());
    for (const Tetrahedron& tet : fresh) {
        if (dead_.empty()) {
            dead_.push_back(static_cast<std::uint32_t>(tets_.size()));
            tets_.emplace_back();
            worth_.emplace_back();
            if (!regions_.empty()) regions_.emplace_back();
        }
        const std::uint32_t t = dead_.back();
        dead_.pop_back();
        tets_[t] = tet;
        worth_[t] = worth_of(tet);
        if (!regions_.empty()) regions_[t] = shared_region;
        for (const VertexId v : tet) add_to_star(v, t);
    }
}

void TetStore::add_to_star(VertexId v, std::uint32_t t) {
    Star& star = stars_[v];
    if (star.count == star.capacity) {  // moves to the pool's end, with room for more
        const std::uint64_t begin = pool_.size();
        star.capacity = star.count + star.count / 2 + 4;
        pool_.resize(begin + star.capacity);
        std::copy_n(pool_.begin() + static_cast<std::ptrdiff_t>(star.begin), star.count,
                    pool_.begin() + static_cast<std::ptrdiff_t>(begin));
        star.begin = begin;
    }
    pool_[star.begin + star.count++] = t;
}

void TetStore::take_from_star(VertexId v, std::uint32_t t) {
    Star& star = stars_[v];
    for (std::uint64_t i = star.begin; i < star.begin + star.count; ++i)
        if (pool_[i] == t) {
            pool_[i] = pool_[star.begin + --star.count];
            return;
        }
}

void TetStore::give_to(TetMesh& mesh) {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < tets_.size(); ++t) {
        if (std::isinf(worth_[t])) continue;
        tets_[kept] = tets_[t];
        if (!regions_.empty()) regions_[kept] = regions_[t];
        ++kept;
    }
    tets_.resize(kept);
    if (!regions_.empty()) regions_.resize(kept);
    mesh.points = std::move(points_);
    mesh.tets = std::move(tets_);
    mesh.regions = std::move(regions_);
    mesh.faces.clear();
    mesh.face_regions.clear();
    mesh.tet_properties.clear();
}

}  // namespace vdbgeo
