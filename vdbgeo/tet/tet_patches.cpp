#include "vdbgeo/tet/tet_patches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/tet/tet_ascent.h"
#include "vdbgeo/tet/tet_place.h"

namespace vdbgeo {
namespace {

constexpr double enough = 1.2;  // where the least q is this the patch is left

/// The places of up to four vertices, one after the other.
using Places = Eigen::Matrix<double, 12, 1>;

/// The angles around the corners of a tetrahedron as functions of where those are: a problem for ascend.
class Patch {
 public:
    Patch(const TetStore& store, const SurfaceProjection& onto_surface)
        : store_(store), onto_surface_(onto_surface) {}

    /// False where no corner may move.
    bool gather(std::uint32_t tet);
    Places start() const;
    std::size_t count() const { return corners_.size(); }
    VertexId corner(std::size_t i) const { return corners_[i]; }

    double worth(const Places& x, double floor);
    void slopes(const Places& x, double cut, std::vector<Slope<Places>>& out) const;
    std::optional<Places> place(const Places& x, const Places& d) const;
    double size() const { return size_; }

 private:
    static Vec3d part(const Places& x, std::size_t i) {
        return x.segment<3>(3 * static_cast<Eigen::Index>(i));
    }
    Vec3d point(VertexId v, const Places& x) const {
        const std::size_t i = index(v);
        return i < count() ? part(x, i) : store_.point(v);
    }
    std::size_t index(VertexId v) const {
        return static_cast<std::size_t>(std::find(corners_.begin(), corners_.end(), v) - corners_.begin());
    }
    double stretch(const Places& x) const;
    void tet_slopes(const Tetrahedron& tet, const Places& x, double cut,
                    std::vector<Slope<Places>>& out) const;

    const TetStore& store_;
    const SurfaceProjection& onto_surface_;
    std::vector<VertexId> corners_;
    std::vector<std::uint32_t> tets_;
    double size_ = 0, most_stretch_ = 0;
};

bool Patch::gather(std::uint32_t tet) {
    corners_.clear();
    tets_.clear();
    for (const VertexId v : store_.tet(tet)) {
        if (store_.freedom(v) == VertexFreedom::fixed) continue;
        corners_.push_back(v);
        tets_.insert(tets_.end(), store_.star(v).begin(), store_.star(v).end());
    }
    if (corners_.empty()) return false;
    std::sort(tets_.begin(), tets_.end());
    tets_.erase(std::unique(tets_.begin(), tets_.end()), tets_.end());
    double sum = 0;
    for (const std::uint32_t t : tets_)
        for (const auto& [i, j] : tet_edges) {
            const Tetrahedron& c = store_.tet(t);
            sum +=
                (store_.point(c[static_cast<std::size_t>(i)]) - store_.point(c[static_cast<std::size_t>(j)]))
                    .squaredNorm();
        }
    size_ = std::sqrt(sum / (6 * static_cast<double>(tets_.size())));
    most_stretch_ = std::max(stretch_limit * stretch_limit, stretch(start()));
    return true;
}

Places Patch::start() const {
    Places x = Places::Zero();
    for (std::size_t i = 0; i < count(); ++i)
        x.segment<3>(3 * static_cast<Eigen::Index>(i)) = store_.point(corners_[i]);
    return x;
}

double Patch::stretch(const Places& x) const {
    double most = 0;
    for (const std::uint32_t t : tets_) {
        const Tetrahedron& c = store_.tet(t);
        most = std::max(most,
                        radius_edge_squared(point(c[0], x), point(c[1], x), point(c[2], x), point(c[3], x)));
    }
    return most;
}

double Patch::worth(const Places& x, double floor) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < tets_.size(); ++i) {
        const Tetrahedron& c = store_.tet(tets_[i]);
        least = std::min(least, dihedral_worth(store_.bounds(), point(c[0], x), point(c[1], x),
                                               point(c[2], x), point(c[3], x)));
        if (least <= floor) return least;
    }
    return stretch(x) <= most_stretch_ ? least : 0;
}

void Patch::slopes(const Places& x, double cut, std::vector<Slope<Places>>& out) const {
    out.clear();
    for (const std::uint32_t t : tets_) tet_slopes(store_.tet(t), x, cut, out);
    for (std::size_t i = 0; i < count(); ++i) {
        if (store_.freedom(corners_[i]) != VertexFreedom::surface) continue;
        const Vec3d n = surface_normal(store_, corners_[i], [&](VertexId v) { return point(v, x); });
        for (Slope<Places>& slope : out) {
            auto gradient = slope.gradient.segment<3>(3 * static_cast<Eigen::Index>(i));
            gradient -= n.dot(gradient) * n;
        }
    }
}

/// As Star::petal_slopes, for every corner: with n = (q − p) × (r − p) of a face (p, q, r) and w fixed, the
/// gradient of w·n by p is w × (r − q).
void Patch::tet_slopes(const Tetrahedron& tet, const Places& x, double cut,
                       std::vector<Slope<Places>>& out) const {
    Vec3d p[4], m[4];
    double inverse[4];
    for (std::size_t k = 0; k < 4; ++k) p[k] = point(tet[k], x);
    for (std::size_t k = 0; k < 4; ++k) {
        const auto& f = tet_faces[k];
        const Vec3d n = (p[f[1]] - p[f[0]]).cross(p[f[2]] - p[f[0]]);
        const double length = n.norm();
        if (!(length > 0)) return;
        inverse[k] = 1 / length;
        m[k] = n * inverse[k];
    }
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < i; ++j) {
            const double cosine = -m[i].dot(m[j]);
            const DihedralBounds::Value q = store_.bounds().value(cosine);
            if (!(q.value < cut && q.value > 0)) continue;
            Slope<Places> slope{q.value, Places::Zero()};
            for (const auto& [face, other] : {std::pair{i, j}, std::pair{j, i}}) {
                const Vec3d w = -q.slope * inverse[face] * (m[other] + cosine * m[face]);
                for (std::size_t c = 0; c < 3; ++c) {
                    const auto& f = tet_faces[face];
                    const std::size_t at = index(tet[static_cast<std::size_t>(f[c])]);
                    if (at < count())
                        slope.gradient.segment<3>(3 * static_cast<Eigen::Index>(at)) +=
                            w.cross(p[f[(c + 2) % 3]] - p[f[(c + 1) % 3]]);
                }
            }
            out.push_back(slope);
        }
}

std::optional<Places> Patch::place(const Places& x, const Places& d) const {
    Places to = x;
    for (std::size_t i = 0; i < count(); ++i) {
        const std::optional<Vec3d> landed =
            step_of(store_.freedom(corners_[i]), part(x, i), part(d, i), 0.3 * size_, onto_surface_);
        if (!landed) return std::nullopt;
        to.segment<3>(3 * static_cast<Eigen::Index>(i)) = *landed;
    }
    for (const VertexId v : corners_)
        if (store_.freedom(v) == VertexFreedom::surface &&
            !surface_holds(
                store_, v, [&](VertexId w) { return point(w, x); }, [&](VertexId w) { return point(w, to); }))
            return std::nullopt;
    return to;
}

/// Whether a step was made.
bool move(TetStore& store, Patch& patch, AscentBuffers<Places>& buffers, std::uint32_t epoch) {
    Places x = patch.start();
    double worth = patch.worth(x, 0);
    if (!ascend(patch, enough, x, worth, buffers)) return false;
    for (std::size_t i = 0; i < patch.count(); ++i)
        store.move(patch.corner(i), x.segment<3>(3 * static_cast<Eigen::Index>(i)), epoch);
    return true;
}

/// Batches of patches that may be moved at once: none moves a corner of a tetrahedron that another changes.
std::vector<std::vector<std::uint32_t>> batches_of(const TetStore& store, std::vector<std::uint32_t> tets) {
    std::vector<std::vector<std::uint32_t>> batches;
    std::vector<std::uint32_t> moves_in(store.vertex_count(), 0), left;
    while (!tets.empty()) {
        batches.emplace_back();
        const auto batch = static_cast<std::uint32_t>(batches.size());
        left.clear();
        for (const std::uint32_t t : tets) {
            bool free = true;
            for (const VertexId v : store.tet(t))
                for (const std::uint32_t n : store.star(v))
                    for (const VertexId w : store.tet(n)) free = free && moves_in[w] != batch;
            if (!free) {
                left.push_back(t);
                continue;
            }
            for (const VertexId v : store.tet(t)) moves_in[v] = batch;
            batches.back().push_back(t);
        }
        tets.swap(left);
    }
    return batches;
}

}  // namespace

std::uint64_t move_patches(TetStore& store, const std::vector<std::uint32_t>& bad,
                           const SurfaceProjection& onto_surface, std::vector<std::uint32_t>& tried,
                           std::uint32_t& epoch) {
    tried.resize(store.slot_count(), 0);
    std::vector<std::uint32_t> active;
    for (const std::uint32_t t : bad)
        if (store.changed_around(t) >= tried[t]) active.push_back(t);
    std::uint64_t moves = 0;
    for (const std::vector<std::uint32_t>& batch : batches_of(store, active)) {
        ++epoch;
        std::vector<std::uint8_t> moved(batch.size());
        parallel_blocks(batch.size(), 4, [&](std::size_t begin, std::size_t end) {
            Patch patch(store, onto_surface);
            AscentBuffers<Places> buffers;
            for (std::size_t i = begin; i < end; ++i) {
                moved[i] = patch.gather(batch[i]) && move(store, patch, buffers, epoch);
                tried[batch[i]] = moved[i] ? 0 : epoch;
            }
        });
        moves += static_cast<std::uint64_t>(std::count(moved.begin(), moved.end(), 1));
    }
    return moves;
}

}  // namespace vdbgeo
