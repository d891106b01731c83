#include "vdbgeo/tet/tet_moves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

constexpr int max_steps = 10;  // of one vertex in one go
constexpr int max_trials = 40;
constexpr double least_gain = 1e-3;  // of q, relative: what is less is no step
static const double wide =
    getenv("WIDE") ? atof(getenv("WIDE")) : 0.7;  // angles within this of the worst q take part in the model
constexpr double enough = 1.6;                    // where q is this the vertex is left
constexpr double longest_radius = 2.5;            // over the shortest edge: none beyond it is made longer

/// A tetrahedron around a vertex: the face opposite, and its outward unit normal.
struct Petal {
    Vec3d p, q, r, base;
};

/// An angle near a place: its q and how q changes.
struct Slope {
    double value;
    Vec3d gradient;
};

/// The tetrahedra around one vertex, as a function of where it is.
class Star {
 public:
    explicit Star(const TetStore& store) : store_(store) {}

    void gather(VertexId v);
    /// The least worth at x; where it is not above `floor`, some number that is not.
    double worth(const Vec3d& x, double floor);
    /// The angles at x that are near the worst.
    void slopes(const Vec3d& x, double worst, std::vector<Slope>& out) const;
    /// Root of the mean square length of the edges at v.
    double size() const { return size_; }
    /// The largest square of circumradius over shortest edge at x.
    double radius_edge_squared(const Vec3d& x) const;

 private:
    void petal_slopes(const Petal& petal, const Vec3d& x, double cut, std::vector<Slope>& out) const;

    const TetStore& store_;
    std::vector<Petal> petals_;
    double size_ = 0;
};

void Star::gather(VertexId v) {
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
}

double Star::radius_edge_squared(const Vec3d& x) const {
    double most = 0;
    for (const Petal& s : petals_) {
        const Vec3d a = s.p - x, b = s.q - x, c = s.r - x;
        const double aa = a.squaredNorm(), bb = b.squaredNorm(), cc = c.squaredNorm();
        const Vec3d bc = b.cross(c);
        const double twice_det = 2 * a.dot(bc);
        const double edge =
            std::min({aa, bb, cc, (a - b).squaredNorm(), (b - c).squaredNorm(), (c - a).squaredNorm()});
        const double radius = (aa * bc + bb * c.cross(a) + cc * a.cross(b)).squaredNorm();
        most = std::max(most, radius / (twice_det * twice_det * edge));
    }
    return most;
}

double Star::worth(const Vec3d& x, double floor) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < petals_.size(); ++i) {
        const Petal& s = petals_[i];
        const double worth = dihedral_worth(store_.bounds(), x, s.p, s.q, s.r, s.base);
        if (worth < least) least = worth;
        if (worth <= floor) {  // the next trial will likely fail here too
            std::swap(petals_[i], petals_[i / 2]);
            return worth;
        }
    }
    return least;
}

void Star::slopes(const Vec3d& x, double worst, std::vector<Slope>& out) const {
    out.clear();
    for (const Petal& petal : petals_) petal_slopes(petal, x, worst + wide, out);
}

/// With outward normals n_i, m_i = n_i/|n_i| and c = −m_i·m_j the cosine of the angle between faces i and j,
/// dc = −(m_j + c m_i)/|n_i|·dn_i − (m_i + c m_j)/|n_j|·dn_j; and dn = e × dx where e is the side of the face
/// that is opposite x.
void Star::petal_slopes(const Petal& s, const Vec3d& x, double cut, std::vector<Slope>& out) const {
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
    const DihedralBounds& bounds = store_.bounds();
    const double square = cut * cut;
    const auto add = [&](double cosine, const auto& gradient) {
        const double low = (1 - cosine) * bounds.low_scale, high = (1 + cosine) * bounds.high_scale;
        const double worth = std::min(low, high);
        if (!(worth < square) || !(worth > 0)) return;
        const double q = std::sqrt(worth);
        const double slope = (low < high ? -bounds.low_scale : bounds.high_scale) / (2 * q);
        out.push_back({q, slope * gradient()});
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

/// The d that maximises min_i (value_i + gradient_i·d) − |d|²/2τ: d = τ Σ λ_i gradient_i, with the λ of the
/// dual found pair by pair. `predicted` is the minimum there.
Vec3d model_step(const std::vector<Slope>& slopes, double tau, std::vector<double>& lambda,
                 double& predicted) {
    const std::size_t n = slopes.size();
    lambda.assign(n, 0);
    std::size_t low = 0;
    for (std::size_t i = 1; i < n; ++i)
        if (slopes[i].value < slopes[low].value) low = i;
    const double start = slopes[low].value;
    lambda[low] = 1;
    Vec3d d = tau * slopes[low].gradient;
    for (int round = 0; round < 40; ++round) {
        std::size_t high = n;
        double least = std::numeric_limits<double>::infinity(), most = -least;
        for (std::size_t i = 0; i < n; ++i) {
            const double value = slopes[i].value + slopes[i].gradient.dot(d);
            if (value < least) least = value, low = i;
            if (lambda[i] > 0 && value > most) most = value, high = i;
        }
        predicted = least;
        if (most - least <= 0.05 * (least - start)) break;
        const Vec3d apart = slopes[low].gradient - slopes[high].gradient;
        const double square = apart.squaredNorm();
        if (!(square > 0)) break;
        const double shift = std::min(lambda[high], (most - least) / (tau * square));
        lambda[high] -= shift;
        lambda[low] += shift;
        d += tau * shift * apart;
    }
    return d;
}

/// One vertex after another; buffers are kept.
class Mover {
 public:
    Mover(TetStore& store, const SurfaceProjection& onto_surface)
        : store_(store), onto_surface_(onto_surface), star_(store) {}

    /// Whether the vertex moved.
    bool move(VertexId v, std::uint32_t epoch);

 private:
    std::optional<Vec3d> place(VertexId v, const Vec3d& from, Vec3d d) const;
    bool surface_holds(VertexId v, const Vec3d& from, const Vec3d& to) const;
    void to_tangent_plane(VertexId v, const Vec3d& x);

    TetStore& store_;
    const SurfaceProjection& onto_surface_;
    Star star_;
    std::vector<Slope> slopes_;
    std::vector<double> lambda_;
};

Vec3d area_vector(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return (b - a).cross(c - a); }

/// A boundary triangle may turn by up to 60° in a step, and two of them that share an edge of the vertex may
/// not come nearer to lying against each other than 60° (or than they did).
bool Mover::surface_holds(VertexId v, const Vec3d& from, const Vec3d& to) const {
    bool good = true;
    store_.for_fan(v, [&](const Triangle& f) {
        const Vec3d &b = store_.point(f[1]), &c = store_.point(f[2]);
        const Vec3d before = area_vector(from, b, c), after = area_vector(to, b, c);
        const double scale = before.norm() * after.norm();
        good = good && scale > 0 && before.dot(after) > 0.5 * scale;
    });
    return good;
}

std::optional<Vec3d> Mover::place(VertexId v, const Vec3d& from, Vec3d d) const {
    const double longest = 0.3 * star_.size(), length = d.norm();
    if (length > longest) d *= longest / length;
    if (store_.freedom(v) == VertexFreedom::free) return from + d;
    const std::optional<Vec3d> landed = onto_surface_(from + d);
    if (!landed || !landed->allFinite()) return std::nullopt;
    if ((*landed - from).norm() > 2 * d.norm() || !surface_holds(v, from, *landed)) return std::nullopt;
    return landed;
}

void Mover::to_tangent_plane(VertexId v, const Vec3d& x) {
    Vec3d n = Vec3d::Zero();
    store_.for_fan(v,
                   [&](const Triangle& f) { n += area_vector(x, store_.point(f[1]), store_.point(f[2])); });
    const double length = n.norm();
    if (!(length > 0)) return;
    n /= length;
    for (Slope& slope : slopes_) slope.gradient -= n.dot(slope.gradient) * n;
}

bool Mover::move(VertexId v, std::uint32_t epoch) {
    double worth = std::numeric_limits<double>::infinity();
    for (const std::uint32_t t : store_.star(v)) worth = std::min(worth, store_.worth(t));
    if (!(worth < enough * enough)) return false;
    star_.gather(v);
    const Vec3d start = store_.point(v);
    Vec3d x = start;
    const double most_stretched = std::max(longest_radius * longest_radius, star_.radius_edge_squared(x));
    double tau = 0;
    bool moved = false, fresh = true;
    for (int step = 0, trial = 0; step < max_steps && trial < max_trials && worth < enough * enough;
         ++trial) {
        if (fresh) {
            star_.slopes(x, std::sqrt(worth), slopes_);
            if (slopes_.empty()) break;
            if (store_.freedom(v) == VertexFreedom::surface) to_tangent_plane(v, x);
        }
        if (tau == 0) {
            double steepest = 0;
            for (const Slope& s : slopes_) steepest = std::max(steepest, s.gradient.squaredNorm());
            if (!(steepest > 0)) break;
            tau = 0.2 * star_.size() / std::sqrt(steepest);
        }
        const double q = std::sqrt(worth);
        double predicted = 0;
        const Vec3d d = model_step(slopes_, tau, lambda_, predicted);
        if (predicted < q * (1 + least_gain) || d.norm() < 1e-4 * star_.size()) break;
        const std::optional<Vec3d> to = place(v, x, d);
        const double least = worth * (1 + 2 * least_gain);
        const double there = to ? star_.worth(*to, std::max(least, 1e-12)) : 0;
        fresh = there > least && there > 1e-12 && star_.radius_edge_squared(*to) <= most_stretched;
        if (!fresh) {
            tau *= 0.3;
            continue;
        }
        tau *= std::sqrt(there) - q > 0.5 * (predicted - q) ? 1.7 : 0.7;
        x = *to, worth = there, moved = true;
        ++step;
    }
    if (moved) store_.move(v, x, epoch);
    return moved;
}

/// Colours: no two of `vertices` of one colour share a tetrahedron. First fit, in order.
std::vector<std::vector<VertexId>> coloured(const TetStore& store, const std::vector<VertexId>& vertices) {
    std::vector<std::vector<VertexId>> colours;
    std::vector<std::uint8_t> colour(store.vertex_count(), 0);  // 0: none
    for (const VertexId v : vertices) {
        std::array<bool, 256> taken{};
        for (const std::uint32_t t : store.star(v))
            for (const VertexId w : store.tet(t)) taken[colour[w]] = true;
        std::size_t c = 1;
        while (c < 256 && taken[c]) ++c;
        if (c == 256) continue;  // another time
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
    const std::vector<std::vector<VertexId>> colours = coloured(store, active);
    std::uint64_t moves = 0;
    std::size_t done = 0;
    for (const std::vector<VertexId>& same : colours) {
        ++epoch;
        std::vector<std::uint8_t> moved(same.size());
        parallel_blocks(same.size(), 64, [&](std::size_t begin, std::size_t end) {
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
