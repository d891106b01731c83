#include "vdbgeo/measure/normal_voting.h"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <atomic>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/measure/geodesic_disc.h"
#include "vdbgeo/measure/one_ring.h"
#include "vdbgeo/measure/tangent_tensor.h"

namespace vdbgeo {
namespace {

constexpr std::size_t grain = 1 << 8;
constexpr double default_radius = 5;  // mean edges
constexpr double pi = 3.14159265358979323846;
constexpr const char* stage = "curvature";

/// What votes, and how far.
struct Electorate {
    const TriMesh& mesh;
    const VertexFaces& faces;
    double reach;               ///< along the surface
    Array<Vec3d> own, voted;    ///< unit normals of the vertices
    Array<double> area;         ///< a third of the faces at a vertex
    Array<Vec3f> face_normals;  ///< area-weighted, twice

    double fading(double distance) const { return std::exp(-3 * distance / reach); }
    Vec3d point(VertexId v) const { return mesh.points[v].cast<double>(); }
};

/// Of the faces, and of the vertices by their faces.
void find_normals(Electorate& all) {
    const TriMesh& mesh = all.mesh;
    all.face_normals.resize(mesh.triangles.size());
    parallel_for(mesh.triangles.size(), grain, [&](std::size_t f) {
        const Triangle& t = mesh.triangles[f];
        const Vec3d a = all.point(t[0]);
        all.face_normals[f] = (all.point(t[1]) - a).cross(all.point(t[2]) - a).cast<float>();
    });
    for (auto* normals : {&all.own, &all.voted}) normals->resize(mesh.points.size());
    all.area.resize(mesh.points.size());
    parallel_blocks(mesh.points.size(), grain, [&](std::size_t begin, std::size_t end) {
        OneRing ring(mesh, all.faces);
        for (std::size_t v = begin; v < end; ++v) {
            ring.fill(static_cast<VertexId>(v));
            Vec3d sum = Vec3d::Zero();
            double area = 0;
            for (std::size_t k = 0; k < ring.size(); ++k) {
                const Vec3d normal = all.face_normals[ring.face(k)].cast<double>();
                sum += normal;
                area += normal.norm();
            }
            all.own[v] = sum.stableNormalized();
            all.area[v] = area / 6;
        }
    });
}

/// Walks the discs of vertices one after another; one object a thread.
class Voting {
 public:
    explicit Voting(const Electorate& all)
        : all_(all), disc_(all.mesh, all.faces), stamp_(all.mesh.triangles.size(), 0) {}

    Vec3d normal(VertexId v);
    /// The sum of the curvatures' votes over that of their weights; none without any.
    std::optional<TangentTensor> curvature(VertexId v);

 private:
    void add_normal_vote(std::uint32_t f, const Vec3d& centre, Mat3d& votes) const;
    double bend(const Vec3d& normal, const Vec3d& tangent, const Vec3d& other) const;

    const Electorate& all_;
    GeodesicDisc disc_;
    std::uint32_t now_ = 0;
    std::vector<std::uint32_t> stamp_;
};

void Voting::add_normal_vote(std::uint32_t f, const Vec3d& centre, Mat3d& votes) const {
    Vec3d middle = Vec3d::Zero();
    double distance = 0;
    for (const VertexId w : all_.mesh.triangles[f]) {
        middle += all_.point(w) / 3;
        distance += disc_.distance(w) / 3;
    }
    if (distance > all_.reach) return;
    const Vec3d normal = all_.face_normals[f].cast<double>(), way = middle - centre;
    const double twice_area = normal.norm(), way2 = way.squaredNorm();
    if (!(twice_area > 0 && way2 > 0)) return;
    const Vec3d vote = normal - 2 * normal.dot(way) / way2 * way;
    votes += all_.fading(distance) / twice_area * vote * vote.transpose();
}

Vec3d Voting::normal(VertexId v) {
    if (++now_ == 0) {
        std::fill(stamp_.begin(), stamp_.end(), 0);
        now_ = 1;
    }
    const Vec3d centre = all_.point(v);
    Mat3d votes = Mat3d::Zero();
    for (const GeodesicDisc::Member& member : disc_.find(v, all_.reach))
        for (const std::uint32_t *f = all_.faces.begin(member.vertex), *last = all_.faces.end(member.vertex);
             f != last; ++f)
            if (stamp_[*f] != now_ && !disc_.is_cap(*f)) {
                stamp_[*f] = now_;
                add_normal_vote(*f, centre, votes);
            }
    const double scale = votes.trace();
    if (!(scale > 0)) return all_.own[v];
    const Eigen::SelfAdjointEigenSolver<Mat3d> solver(votes / scale);
    const Vec3d axis = solver.eigenvectors().col(2);
    return axis.dot(all_.own[v]) < 0 ? Vec3d(-axis) : axis;
}

/// 2 sin(φ/2), φ the angle from `normal` to `other` in the plane of `normal` and `tangent`.
double Voting::bend(const Vec3d& normal, const Vec3d& tangent, const Vec3d& other) const {
    const double up = other.dot(normal), along = other.dot(tangent), length = std::hypot(up, along);
    if (!(length > 0)) return 0;
    if (up > 0) return along / length / std::sqrt(0.5 * (1 + up / length));
    return std::copysign(std::sqrt(2 * (1 - up / length)), along);
}

std::optional<TangentTensor> Voting::curvature(VertexId v) {
    const Vec3d centre = all_.point(v), normal = all_.voted[v];
    TangentTensor votes;
    double weights = 0;
    for (const GeodesicDisc::Member& member : disc_.find(v, all_.reach)) {
        const Vec3d way = all_.point(member.vertex) - centre;
        const Vec3d tangent = way - way.dot(normal) * normal;
        const double length = tangent.norm();
        if (!(length > 0)) continue;
        const double weight = all_.area[member.vertex] * all_.fading(member.distance);
        const Vec3d unit = tangent / length;
        votes.add(unit, weight * bend(normal, unit, all_.voted[member.vertex]) / way.norm());
        weights += weight;
    }
    if (!(weights > 0)) return std::nullopt;
    votes.scale(1 / weights);
    return votes;
}

void put(Curvatures& out, VertexId v, const Vec3d& normal, const std::optional<TangentTensor>& votes) {
    if (!votes) return out.set_undefined(v);
    const TangentTensor::Axes b = votes->axes(normal);
    out.set_from_principal(v, 3 * b.larger - b.smaller, 3 * b.smaller - b.larger, b.of_larger, b.of_smaller);
}

/// Calls body(voting, vertex) for all vertices.
template <class Body>
void for_vertices(const Electorate& all, const Progress& progress, const Body& body) {
    const std::size_t count = all.mesh.points.size();
    std::atomic<std::uint64_t> done{0};
    tbb::enumerable_thread_specific<Voting> votings([&] { return Voting(all); });
    parallel_blocks(count, grain, [&](std::size_t begin, std::size_t end) {
        Voting& voting = votings.local();
        for (std::size_t v = begin; v < end; ++v) body(voting, static_cast<VertexId>(v));
        progress.report(static_cast<double>(done += end - begin) / static_cast<double>(count));
    });
}

}  // namespace

void NormalVotingOptions::check() const {
    if (radius && !(*radius > 0 && std::isfinite(*radius)))
        throw InvalidInput(fmt::format("curvature: the radius must be above 0 Å, not {}", *radius));
}

Curvatures voted_curvature(const TriMesh& mesh, const NormalVotingOptions& options,
                           const Progress& progress) {
    options.check();
    check_curvature_input(mesh, stage);
    const VertexFaces faces(mesh);
    Curvatures out;
    out.resize(mesh.points.size(), true);
    out.flags = curvature_flags(mesh, faces, stage);
    const double radius = options.radius ? *options.radius : default_radius * mean_edge(mesh);
    Electorate all{mesh, faces, pi * radius / 2, {}, {}, {}, {}};
    find_normals(all);
    for_vertices(all, progress.part(0, 0.5), [&](Voting& voting, VertexId v) {
        all.voted[v] = out.defined(v) ? voting.normal(v) : all.own[v];
    });
    for_vertices(all, progress.part(0.5, 1), [&](Voting& voting, VertexId v) {
        if (out.defined(v))
            put(out, v, all.voted[v], voting.curvature(v));
        else
            out.set_undefined(v);
    });
    return out;
}

}  // namespace vdbgeo
