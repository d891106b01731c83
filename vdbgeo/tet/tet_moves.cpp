#include "vdbgeo/tet/tet_moves.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/tet/tet_ascent.h"
#include "vdbgeo/tet/tet_place.h"

namespace vdbgeo {
namespace {

constexpr double enough = 1.6;  // where the least q is this the vertex is left

/// A tetrahedron around a vertex: the face opposite, and its outward unit normal.
struct Petal {
    Vec3d p, q, r, base;
};

/// The angles around one vertex as functions of where it is: a problem for ascend.
class Star {
 public:
    Star(const TetStore& store, const SurfaceProjection& onto_surface)
        : store_(store), onto_surface_(onto_surface) {}

    void gather(VertexId v);

    double worth(const Vec3d& x, double floor);
    void slopes(const Vec3d& x, double cut, std::vector<Slope<Vec3d>>& out) const;
    std::optional<Vec3d> place(const Vec3d& x, const Vec3d& d) const;
    /// Root of the mean square length of the edges at the vertex.
    double size() const { return size_; }

 private:
    double stretch(const Vec3d& x) const;
    void petal_slopes(const Petal& petal, const Vec3d& x, double cut, std::vector<Slope<Vec3d>>& out) const;

    const TetStore& store_;
    const SurfaceProjection& onto_surface_;
    VertexId vertex_ = 0;
    std::vector<Petal> petals_;
    double size_ = 0, most_stretch_ = 0;
};

void Star::gather(VertexId v) {
    vertex_ = v;
    petals_.clear();
    const Vec3d& x = store_.point(v);
    double sum = 0;
    for (const std::uint32_t t : store_.star(v)) {
        const Tetrahedron& tet = store_.tet(t);
        const auto k = static_cast<std::size_t>(std::find(tet.begin(), tet.end(), v) - tet.begin());
        const auto corner = [&](std::size_t c) -> const Vec3d& {
            return store_.point(tet[static_cast<std::size_t>(tet_faces[k][c])]);
        };
        Petal petal{corner(0), corner(1), corner(2), Vec3d::Zero()};
        const Vec3d n = (petal.q - petal.p).cross(petal.r - petal.p);
        const double length = n.norm();
        if (length > 0) petal.base = n / length;
        sum += (petal.p - x).squaredNorm() + (petal.q - x).squaredNorm() + (petal.r - x).squaredNorm();
        petals_.push_back(petal);
    }
    size_ = petals_.empty() ? 0 : std::sqrt(sum / (3 * static_cast<double>(petals_.size())));
    most_stretch_ = std::max(stretch_limit * stretch_limit, stretch(x));
}

/// The largest square of circumradius over shortest edge.
double Star::stretch(const Vec3d& x) const {
    double most = 0;
    for (const Petal& s : petals_) most = std::max(most, radius_edge_squared(x, s.p, s.q, s.r));
    return most;
}

double Star::worth(const Vec3d& x, double floor) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < petals_.size(); ++i) {
        const Petal& s = petals_[i];
        least = std::min(least, dihedral_worth(store_.bounds(), x, s.p, s.q, s.r, s.base));
        if (least > floor) continue;
        std::swap(petals_[i], petals_[i / 2]);  // the next trial will likely fail here too
        return least;
    }
    return stretch(x) <= most_stretch_ ? least : 0;
}

void Star::slopes(const Vec3d& x, double cut, std::vector<Slope<Vec3d>>& out) const {
    out.clear();
    for (const Petal& petal : petals_) petal_slopes(petal, x, cut, out);
    if (store_.freedom(vertex_) != VertexFreedom::surface) return;
    const Vec3d n =
        surface_normal(store_, vertex_, [&](VertexId v) { return v == vertex_ ? x : store_.point(v); });
    for (Slope<Vec3d>& slope : out) slope.gradient -= n.dot(slope.gradient) * n;
}

/// With outward normals n_i, m_i = n_i/|n_i| and c = −m_i·m_j the cosine of the angle between faces i and j,
/// dc = −(m_j + c m_i)/|n_i|·dn_i − (m_i + c m_j)/|n_j|·dn_j; and dn = e × dx where e is the side of the face
/// that is opposite x.
void Star::petal_slopes(const Petal& s, const Vec3d& x, double cut, std::vector<Slope<Vec3d>>& out) const {
    const Vec3d a = s.p - x, b = s.q - x, c = s.r - x;
    const Vec3d n[3] = {c.cross(b), a.cross(c), b.cross(a)};
    const Vec3d side[3] = {s.q - s.r, s.r - s.p, s.p - s.q};
    double inverse[3];
    Vec3d m[3];
    for (int i = 0; i < 3; ++i) {
        const double length = n[i].norm();
        if (!(length > 0)) return;
        inverse[i] = 1 / length;
        m[i] = n[i] * inverse[i];
    }
    const auto add = [&](double cosine, const auto& gradient) {
        const DihedralBounds::Value q = store_.bounds().value(cosine);
        if (q.value < cut && q.value > 0) out.push_back({q.value, q.slope * gradient()});
    };
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        const double cosine = -m[i].dot(m[j]);
        add(cosine, [&]() -> Vec3d {
            return -((m[j] + cosine * m[i]) * inverse[i]).cross(side[i]) -
                   ((m[i] + cosine * m[j]) * inverse[j]).cross(side[j]);
        });
        const double at_base = -s.base.dot(m[i]);
        add(at_base, [&]() -> Vec3d { return -((s.base + at_base * m[i]) * inverse[i]).cross(side[i]); });
    }
}

std::optional<Vec3d> Star::place(const Vec3d& x, const Vec3d& d) const {
    const std::optional<Vec3d> to = step_of(store_.freedom(vertex_), x, d, 0.3 * size_, onto_surface_);
    if (!to || store_.freedom(vertex_) == VertexFreedom::free) return to;
    const auto from_x = [&](VertexId v) { return v == vertex_ ? x : store_.point(v); };
    const auto from_to = [&](VertexId v) { return v == vertex_ ? *to : store_.point(v); };
    return surface_holds(store_, vertex_, from_x, from_to) ? to : std::nullopt;
}

/// One vertex after another; buffers are kept.
class Mover {
 public:
    Mover(TetStore& store, const SurfaceProjection& onto_surface)
        : store_(store), star_(store, onto_surface) {}

    /// Whether the vertex moved.
    bool move(VertexId v, std::uint32_t epoch) {
        double worth = std::numeric_limits<double>::infinity();
        for (const std::uint32_t t : store_.star(v)) worth = std::min(worth, store_.worth(t));
        if (!(worth < enough * enough)) return false;
        star_.gather(v);
        Vec3d x = store_.point(v);
        if (!ascend(star_, enough, x, worth, buffers_)) return false;
        store_.move(v, x, epoch);
        return true;
    }

 private:
    TetStore& store_;
    Star star_;
    AscentBuffers<Vec3d> buffers_;
};

/// No two of `vertices` of one colour share a tetrahedron. First fit, in order.
std::vector<std::vector<VertexId>> coloured(const TetStore& store, const std::vector<VertexId>& vertices) {
    constexpr std::size_t most = 64;
    std::vector<std::vector<VertexId>> colours;
    std::vector<std::uint8_t> colour(store.vertex_count(), 0);  // 0: none
    for (const VertexId v : vertices) {
        std::uint64_t taken = 1;
        for (const std::uint32_t t : store.star(v))
            for (const VertexId w : store.tet(t)) taken |= std::uint64_t{1} << colour[w];
        std::size_t c = 1;
        while (c < most && (taken >> c & 1) != 0) ++c;
        if (c == most) continue;  // another time
        colour[v] = static_cast<std::uint8_t>(c);
        if (colours.size() < c) colours.emplace_back();
        colours[c - 1].push_back(v);
    }
    return colours;
}

}  // namespace

std::uint64_t move_vertices(TetStore& store, const std::vector<VertexId>& vertices,
                            const SurfaceProjection& onto_surface, std::vector<std::uint32_t>& tried,
                            std::uint32_t& epoch, const Progress& progress) {
    std::vector<VertexId> active;
    for (const VertexId v : vertices)
        if (store.freedom(v) != VertexFreedom::fixed && store.changed(v) >= tried[v]) active.push_back(v);
    std::uint64_t moves = 0;
    std::size_t done = 0;
    for (const std::vector<VertexId>& same : coloured(store, active)) {
        ++epoch;
        std::vector<std::uint8_t> moved(same.size());
        parallel_blocks(same.size(), 32, [&](std::size_t begin, std::size_t end) {
            Mover mover(store, onto_surface);
            for (std::size_t i = begin; i < end; ++i) {
                moved[i] = mover.move(same[i], epoch);
                tried[same[i]] = moved[i] ? 0 : epoch;
            }
        });
        moves += static_cast<std::uint64_t>(std::count(moved.begin(), moved.end(), 1));
        progress.report(static_cast<double>(done += same.size()) / static_cast<double>(active.size()));
    }
    return moves;
}

}  // namespace vdbgeo
