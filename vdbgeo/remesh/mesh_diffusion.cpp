#include "vdbgeo/remesh/mesh_diffusion.h"

#include <Eigen/SparseCholesky>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/vertex_neighbours.h"

namespace vdbgeo {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Vector = Eigen::VectorXd;

/// A mass is at least this part of a third of the area around: where a surface folds back, area vectors
/// cancel.
constexpr double least_mass = 0.01;
/// Angles below about half a degree count as that: their cotangents would drown the others' digits.
constexpr double most_cotangent = 100;

/// One step's operators over the free vertices.
class Step {
 public:
    Step(const TriMesh& mesh, const Array<Vec3d>& points, const Array<char>& fixed);

    /// The way along the normal of each free vertex; throws NumericalError.
    Vector solve(double dt) const;

    /// The unit normal of a vertex, 0 where it has none.
    const Vec3d& normal(std::size_t v) const { return normals_[v]; }
    /// The row of a vertex; −1: it stays.
    int row(std::size_t v) const { return rows_[v]; }

 private:
    void number(const TriMesh& mesh, const Array<char>& fixed);
    void add_face(const Triangle& t, const Array<Vec3d>& points);

    std::vector<int> rows_;
    int free_ = 0;
    Array<Vec3d> normals_, stiff_;  ///< stiff_: L x
    Vector mass_, curvature_;
    std::vector<Eigen::Triplet<double>> entries_;
    Sparse stiffness_;  ///< between free vertices alone: nothing flows over the border
};

Step::Step(const TriMesh& mesh, const Array<Vec3d>& points, const Array<char>& fixed) {
    number(mesh, fixed);
    normals_.assign(points.size(), Vec3d::Zero());
    stiff_.assign(points.size(), Vec3d::Zero());
    std::vector<double> area(points.size(), 0);
    entries_.reserve(12 * mesh.triangles.size());
    for (const Triangle& t : mesh.triangles) {
        const Vec3d vector = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]) / 6;
        const double third = vector.norm();
        for (const VertexId v : t) {
            normals_[v] += vector;
            area[v] += third;
        }
        if (third > 0) add_face(t, points);
    }
    stiffness_.resize(free_, free_);
    stiffness_.setFromTriplets(entries_.begin(), entries_.end());
    entries_ = {};
    mass_ = Vector::Zero(free_);
    curvature_ = Vector::Zero(free_);
    for (std::size_t v = 0; v < points.size(); ++v) {
        const double length = normals_[v].norm();
        if (length > 0) normals_[v] /= length;
        if (rows_[v] < 0) continue;
        const double mass = std::max(length, least_mass * area[v]);
        mass_[rows_[v]] = mass > 0 ? mass : 1;
        curvature_[rows_[v]] = mass > 0 ? normals_[v].dot(stiff_[v]) / mass : 0;
    }
}

void Step::number(const TriMesh& mesh, const Array<char>& fixed) {
    rows_.assign(mesh.points.size(), -1);
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t)
            if (!fixed[v]) rows_[v] = 0;
    for (int& row : rows_)
        if (row == 0) row = free_++;
}

void Step::add_face(const Triangle& t, const Array<Vec3d>& points) {
    for (std::size_t i = 0; i < 3; ++i) {
        const VertexId u = t[(i + 1) % 3], v = t[(i + 2) % 3];
        const Vec3d a = points[u] - points[t[i]], b = points[v] - points[t[i]];
        const double sine = a.cross(b).norm(), cosine = a.dot(b);
        const double cotangent =
            std::abs(cosine) < most_cotangent * sine ? cosine / sine : std::copysign(most_cotangent, cosine);
        const Vec3d pull = cotangent / 2 * (points[u] - points[v]);
        stiff_[u] += pull;
        stiff_[v] -= pull;
        if (rows_[u] < 0 || rows_[v] < 0) continue;
        entries_.emplace_back(rows_[u], rows_[u], cotangent / 2);
        entries_.emplace_back(rows_[v], rows_[v], cotangent / 2);
        entries_.emplace_back(rows_[u], rows_[v], -cotangent / 2);
        entries_.emplace_back(rows_[v], rows_[u], -cotangent / 2);
    }
}

Vector Step::solve(double dt) const {
    if (free_ == 0) return {};
    Sparse matrix = dt * (stiffness_ * mass_.cwiseInverse().asDiagonal() * stiffness_);
    for (int i = 0; i < free_; ++i) matrix.coeffRef(i, i) += mass_[i];
    Eigen::SimplicialLDLT<Sparse> solver(matrix);
    Vector way;
    if (solver.info() == Eigen::Success) way = solver.solve(-dt * (stiffness_ * curvature_));
    if (solver.info() != Eigen::Success || !way.allFinite())
        throw NumericalError(fmt::format(
            "mesh diffusion: the system of a step of {} A^4 cannot be solved; try more steps", dt));
    return way;
}

}  // namespace

void MeshDiffusionOptions::check() const {
    if (!(std::isfinite(time) && time >= 0))
        throw InvalidInput(fmt::format("mesh diffusion: time {} A^4 where 0 or more is needed", time));
    if (steps < 1) throw InvalidInput(fmt::format("mesh diffusion: {} steps", steps));
}

TriMesh mesh_diffusion(const TriMesh& mesh, const MeshDiffusionOptions& options, const Progress& progress) {
    options.check();
    check(mesh, "mesh diffusion");
    if (mesh.points.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
        throw InvalidInput("mesh diffusion: over 2^31 vertices");
    if (options.time == 0 || mesh.empty()) return mesh;
    const Array<char> fixed = VertexNeighbours(mesh).fixed;
    Array<Vec3d> points(mesh.points.size());
    for (std::size_t v = 0; v < points.size(); ++v) points[v] = mesh.points[v].cast<double>();
    for (int i = 0; i < options.steps; ++i) {
        const Step step(mesh, points, fixed);
        const Vector way = step.solve(options.time / options.steps);
        for (std::size_t v = 0; v < points.size(); ++v)
            if (step.row(v) >= 0) points[v] += way[step.row(v)] * step.normal(v);
        progress.report(double(i + 1) / options.steps);
    }
    TriMesh result = mesh;
    for (std::size_t v = 0; v < points.size(); ++v) result.points[v] = points[v].cast<float>();
    return result;
}

}  // namespace vdbgeo
