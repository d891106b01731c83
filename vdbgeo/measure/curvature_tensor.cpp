#include "vdbgeo/measure/curvature_tensor.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/face_bends.h"
#include "vdbgeo/measure/geodesic_disc.h"
#include "vdbgeo/measure/one_ring.h"
#include "vdbgeo/measure/tangent_tensor.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 11;
constexpr double default_radius = 3;  // mean edges
constexpr double least_normal = 0.1;  // share of the area that the normals of a neighbourhood add up to
constexpr const char* stage = "curvature";

/// What a neighbourhood adds up to.
struct Sums {
    TangentTensor tensor;
    double area = 0;
    Vec3d normal = Vec3d::Zero();  ///< area-weighted

    void add_face(const Vec3d& unit_normal, double part) {
        area += part;
        normal += part * unit_normal;
    }
    /// An edge with a bend, and the share of its length that counts.
    void add_edge(const Vec3d& edge, double bend, double share) {
        const double length = edge.norm();
        if (length > 0) tensor.add(edge, bend * share / length);
    }
};

/// Gathers the sums of one neighbourhood after another; one object a thread.
class Gather {
 public:
    Gather(const TriMesh& mesh, const VertexFaces& faces, const FaceBends& bends, double radius,
           TensorNeighbourhood kind)
        : mesh_(mesh), faces_(faces), bends_(bends), radius_(radius), kind_(kind) {
        if (kind == TensorNeighbourhood::geodesic) disc_.emplace(mesh, faces);
        if (kind != TensorNeighbourhood::ring) stamp_.assign(mesh.triangles.size(), 0);
    }

    Sums at(const OneRing& ring) {
        if (kind_ == TensorNeighbourhood::ring) return over_ring(ring);
        if (++now_ == 0) {
            std::fill(stamp_.begin(), stamp_.end(), 0);
            now_ = 1;
        }
        Sums sums = kind_ == TensorNeighbourhood::ball ? over_ball(ring) : over_disc(ring);
        // All round a small piece normals cancel; the vertex has its own.
        if (sums.normal.norm() < least_normal * sums.area) sums.normal = over_ring(ring).normal;
        return sums;
    }

 private:
    struct Face {
        std::array<Vec3d, 3> points, sides;  ///< relative to the centre; side k from corner k to k + 1
        Vec3d normal = Vec3d::Zero();        ///< unit, zero without an area
        double area = 0;
    };
    struct Cut {
        double from = 0, to = 1;
        bool empty() const { return !(to > from); }
    };

    bool mark(std::uint32_t f) { return stamp_[f] != now_ && (stamp_[f] = now_, true); }
    Face face_of(std::uint32_t f, const Vec3d& centre) const;
    Sums over_ring(const OneRing& ring) const;
    Sums over_ball(const OneRing& ring);
    Sums over_disc(const OneRing& ring);
    void add_ball_face(std::uint32_t f, const Vec3d& centre, Sums& sums);
    Cut cut_by_sphere(const Vec3d& from, const Vec3d& side, double from2, double to2) const;
    double area_in_ball(const Face& face, const std::array<Cut, 3>& cuts) const;

    const TriMesh& mesh_;
    const VertexFaces& faces_;
    const FaceBends& bends_;
    double radius_;
    TensorNeighbourhood kind_;
    std::optional<GeodesicDisc> disc_;
    std::uint32_t now_ = 0;
    std::vector<std::uint32_t> stamp_, found_;
};

Gather::Face Gather::face_of(std::uint32_t f, const Vec3d& centre) const {
    Face face;
    for (std::size_t k = 0; k < 3; ++k)
        face.points[k] = mesh_.points[mesh_.triangles[f][k]].cast<double>() - centre;
    for (std::size_t k = 0; k < 3; ++k) face.sides[k] = face.points[(k + 1) % 3] - face.points[k];
    const Vec3d normal = face.sides[0].cross(face.sides[1]);
    const double twice_area = normal.norm();
    if (twice_area > 0) {
        face.normal = normal / twice_area;
        face.area = 0.5 * twice_area;
    }
    return face;
}

Sums Gather::over_ring(const OneRing& ring) const {
    Sums sums;
    const Vec3d centre = mesh_.points[ring.vertex()].cast<double>();
    for (std::size_t j = 0; j < ring.size(); ++j) {
        const std::uint32_t f = ring.face(j);
        const Face face = face_of(f, centre);
        sums.add_face(face.normal, face.area);
        // The sides at the vertex come with both of their faces, the one opposite with one.
        for (std::size_t k = 0; k < 3; ++k)
            sums.add_edge(face.sides[k], bends_.angle[3 * std::size_t{f} + k], 0.5);
    }
    return sums;
}

/// Face after face, over the sides that the sphere does not cut off.
Sums Gather::over_ball(const OneRing& ring) {
    Sums sums;
    const Vec3d centre = mesh_.points[ring.vertex()].cast<double>();
    found_.clear();
    for (std::size_t j = 0; j < ring.size(); ++j) {
        mark(ring.face(j));
        found_.push_back(ring.face(j));
    }
    for (std::size_t next = 0; next < found_.size(); ++next) add_ball_face(found_[next], centre, sums);
    return sums;
}

void Gather::add_ball_face(std::uint32_t f, const Vec3d& centre, Sums& sums) {
    const Face face = face_of(f, centre);
    std::array<Cut, 3> cuts;
    std::array<double, 3> squares;
    for (std::size_t k = 0; k < 3; ++k) squares[k] = face.points[k].squaredNorm();
    for (std::size_t k = 0; k < 3; ++k) {
        cuts[k] = cut_by_sphere(face.points[k], face.sides[k], squares[k], squares[(k + 1) % 3]);
        const std::uint32_t other = bends_.across[3 * std::size_t{f} + k];
        if (cuts[k].empty() || other == FaceBends::none) continue;
        if (mark(other)) found_.push_back(other);
        if (f < other)
            sums.add_edge(face.sides[k], bends_.angle[3 * std::size_t{f} + k], cuts[k].to - cuts[k].from);
    }
    const double radius2 = radius_ * radius_;
    const bool inside = squares[0] <= radius2 && squares[1] <= radius2 && squares[2] <= radius2;
    sums.add_face(face.normal, inside ? face.area : area_in_ball(face, cuts));
}

Gather::Cut Gather::cut_by_sphere(const Vec3d& from, const Vec3d& side, double from2, double to2) const {
    const double radius2 = radius_ * radius_;
    if (from2 <= radius2 && to2 <= radius2) return {};
    const double length2 = side.squaredNorm(), along = from.dot(side);
    const double discriminant = along * along - length2 * (from2 - radius2);
    if (!(discriminant > 0 && length2 > 0)) return {0, 0};
    const double root = std::sqrt(discriminant);
    return {std::max(0.0, (-along - root) / length2), std::min(1.0, (root - along) / length2)};
}

/// The sides' parts within the circle bound triangles about its centre, their parts outside bound sectors.
double Gather::area_in_ball(const Face& face, const std::array<Cut, 3>& cuts) const {
    const double height = face.points[0].dot(face.normal);
    const double circle2 = radius_ * radius_ - height * height;
    if (!(circle2 > 0 && face.area > 0)) return 0;
    const auto turn = [&](const Vec3d& a, const Vec3d& b) { return a.cross(b).dot(face.normal); };
    double twice = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3d a = face.points[k] - height * face.normal, b = a + face.sides[k];
        const auto sector = [&](const Vec3d& from, const Vec3d& to) {
            return circle2 * std::atan2(turn(from, to), from.dot(to));
        };
        if (cuts[k].empty()) {
            twice += sector(a, b);
            continue;
        }
        const Vec3d in = a + cuts[k].from * face.sides[k], out = a + cuts[k].to * face.sides[k];
        if (cuts[k].from > 0) twice += sector(a, in);
        twice += turn(in, out);
        if (cuts[k].to < 1) twice += sector(out, b);
    }
    return std::max(0.0, 0.5 * twice);
}

/// The share of a segment or triangle on which a linear function is at most `level`.
double share_below(double level, double a, double b) {
    if (a > b) std::swap(a, b);
    return level >= b ? 1 : level <= a ? 0 : (level - a) / (b - a);
}
double share_below(double level, std::array<double, 3> d) {
    std::sort(d.begin(), d.end());
    if (level >= d[2]) return 1;
    if (level <= d[0]) return 0;
    if (level <= d[1]) return (level - d[0]) * (level - d[0]) / ((d[1] - d[0]) * (d[2] - d[0]));
    return 1 - (d[2] - level) * (d[2] - level) / ((d[2] - d[0]) * (d[2] - d[1]));
}

Sums Gather::over_disc(const OneRing& ring) {
    Sums sums;
    const Vec3d centre = mesh_.points[ring.vertex()].cast<double>();
    for (const GeodesicDisc::Member& member : disc_->find(ring.vertex(), radius_))
        for (const std::uint32_t *f = faces_.begin(member.vertex), *last = faces_.end(member.vertex);
             f != last; ++f) {
            if (disc_->is_cap(*f) || !mark(*f)) continue;
            const Face face = face_of(*f, centre);
            std::array<double, 3> d;
            for (std::size_t k = 0; k < 3; ++k) d[k] = disc_->distance(mesh_.triangles[*f][k]);
            sums.add_face(face.normal, face.area * share_below(radius_, d));
            // An edge counts by halves, from either face: the one beyond it may be cut off.
            for (std::size_t k = 0; k < 3; ++k)
                sums.add_edge(face.sides[k], bends_.angle[3 * std::size_t{*f} + k],
                              0.5 * share_below(radius_, d[k], d[(k + 1) % 3]));
        }
    return sums;
}

void put(Curvatures& out, std::size_t v, const Sums& sums) {
    const double length = sums.normal.norm();
    if (!(sums.area > 0 && length > 0)) return out.set_undefined(v);
    const TangentTensor::Axes axes = sums.tensor.axes(sums.normal / length);
    out.set_from_principal(v, axes.larger / sums.area, axes.smaller / sums.area, axes.of_smaller,
                           axes.of_larger);
}

}  // namespace

void CurvatureTensorOptions::check() const {
    if (radius && !(*radius > 0 && std::isfinite(*radius)))
        throw InvalidInput(fmt::format("curvature: the radius must be above 0 Å, not {}", *radius));
}

Curvatures tensor_curvature(const TriMesh& mesh, const CurvatureTensorOptions& options,
                            const Progress& progress) {
    options.check();
    check_curvature_input(mesh, stage);
    const VertexFaces faces(mesh);
    Curvatures out;
    out.resize(mesh.points.size(), true);
    out.flags = curvature_flags(mesh, faces, stage);
    progress.report(0.02);
    const FaceBends bends(mesh, faces);
    progress.report(0.05);
    const double radius = options.radius ? *options.radius : default_radius * mean_edge(mesh);
    const std::size_t count = mesh.points.size();
    const Progress rest = progress.part(0.05, 1);
    std::atomic<std::uint64_t> done{0};
    tbb::enumerable_thread_specific<Gather> gathers(
        [&] { return Gather(mesh, faces, bends, radius, options.neighbourhood); });
    parallel_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
        Gather& gather = gathers.local();
        OneRing ring(mesh, faces);
        for (std::size_t v = begin; v < end; ++v) {
            if (!out.defined(v)) {
                out.set_undefined(v);
                continue;
            }
            ring.fill(static_cast<VertexId>(v));
            put(out, v, gather.at(ring));
        }
        rest.report(static_cast<double>(done += end - begin) / static_cast<double>(count));
    });
    return out;
}

}  // namespace vdbgeo
