// Laplace's equation by linear finite elements: whether a mesh of tetrahedra is one that can be computed on.
#pragma once

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>

#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>
#include <vector>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::test {

/// The gradients of a tetrahedron's four hat functions, and its volume.
struct HatGradients {
    std::array<Vec3d, 4> gradient;
    double volume;

    HatGradients(const TetMesh& mesh, const Tetrahedron& t) {
        Mat3d edges;
        for (int k = 0; k < 3; ++k) edges.row(k) = mesh.points[t[std::size_t(k) + 1]] - mesh.points[t[0]];
        const Mat3d inverse = edges.inverse();
        gradient[0] = Vec3d::Zero();
        for (int k = 0; k < 3; ++k) {
            gradient[std::size_t(k) + 1] = inverse.col(k);
            gradient[0] -= inverse.col(k);
        }
        volume = edges.determinant() / 6;
    }
};

/// The stiffness matrix ∫ ∇φi·∇φj.
inline Eigen::SparseMatrix<double> stiffness(const TetMesh& mesh) {
    std::vector<Eigen::Triplet<double>> entries;
    for (const Tetrahedron& t : mesh.tets) {
        const HatGradients hats(mesh, t);
        for (std::size_t i = 0; i < 4; ++i)
            for (std::size_t j = 0; j < 4; ++j)
                entries.emplace_back(int(t[i]), int(t[j]),
                                     hats.volume * hats.gradient[i].dot(hats.gradient[j]));
    }
    const auto n = Eigen::Index(mesh.points.size());
    Eigen::SparseMatrix<double> matrix(n, n);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
}

struct LaplaceSolution {
    Eigen::VectorXd values;  ///< at the points
    /// ∫ ∂u/∂n over the hats of each point on the boundary (the residual there), outward; 0 within.
    Eigen::VectorXd flux;
};

/// Solves Δu = 0 with u = boundary(p) on the faces whose outside is 0.
inline LaplaceSolution solve_laplace(const TetMesh& mesh,
                                     const std::function<double(const Vec3d&)>& boundary) {
    const Eigen::SparseMatrix<double> all = stiffness(mesh);
    std::vector<char> fixed(mesh.points.size(), 0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f)
        if (mesh.face_regions[f][1] == 0)
            for (const VertexId v : mesh.faces[f]) fixed[v] = 1;
    Eigen::VectorXd u = Eigen::VectorXd::Zero(all.rows());
    std::vector<int> number(mesh.points.size(), -1);
    int unknowns = 0;
    for (std::size_t v = 0; v < fixed.size(); ++v) {
        if (fixed[v])
            u[Eigen::Index(v)] = boundary(mesh.points[v]);
        else
            number[v] = unknowns++;
    }
    if (unknowns == 0) throw std::runtime_error("the mesh has no points within");
    const Eigen::VectorXd known = all * u;
    Eigen::VectorXd right(unknowns);
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index column = 0; column < all.outerSize(); ++column) {
        const int c = number[std::size_t(column)];
        if (c < 0) continue;
        right[c] = -known[column];
        for (Eigen::SparseMatrix<double>::InnerIterator i(all, column); i; ++i)
            if (number[std::size_t(i.row())] >= 0)
                entries.emplace_back(number[std::size_t(i.row())], c, i.value());
    }
    Eigen::SparseMatrix<double> inner(unknowns, unknowns);
    inner.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(inner);
    if (solver.info() != Eigen::Success) throw std::runtime_error("the stiffness matrix has no factors");
    if (!(solver.vectorD().minCoeff() > 0)) throw std::runtime_error("the stiffness matrix is not positive");
    const Eigen::VectorXd solution = solver.solve(right);
    for (std::size_t v = 0; v < number.size(); ++v)
        if (number[v] >= 0) u[Eigen::Index(v)] = solution[number[v]];
    return {u, all * u};
}

/// (∫ (u − exact)²)^½, exact for quadratic differences (the four-point rule of second degree).
inline double l2_error(const TetMesh& mesh, const Eigen::VectorXd& u,
                       const std::function<double(const Vec3d&)>& exact) {
    const double near = (5 + 3 * std::sqrt(5.0)) / 20, far = (5 - std::sqrt(5.0)) / 20;
    double sum = 0;
    for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
        const Tetrahedron& t = mesh.tets[i];
        for (std::size_t q = 0; q < 4; ++q) {
            Vec3d p = Vec3d::Zero();
            double value = 0;
            for (std::size_t k = 0; k < 4; ++k) {
                const double weight = k == q ? near : far;
                p += weight * mesh.points[t[k]];
                value += weight * u[Eigen::Index(t[k])];
            }
            const double difference = value - exact(p);
            sum += tet_determinant(mesh, i) / 24 * difference * difference;
        }
    }
    return std::sqrt(sum);
}

}  // namespace vdbgeo::test
