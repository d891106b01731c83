// Implicit solves along lines once more: a dense matrix for each run of active voxels.
#pragma once

#include <Eigen/Dense>

#include <vector>

#include "tests/support/dense_oracle.h"

namespace vdbgeo::test {

/// L_d L^q times `factor`, one of the terms of the operator; d by voxel.
struct LineTerm {
    int order = 0;
    double factor = 1;
    Values d;
};

/// Row i: Σ d_face (v_i − v_{i±1}) times the weight.
inline Eigen::MatrixXd line_flux(const std::vector<double>& d, double weight) {
    const auto n = static_cast<Eigen::Index>(d.size());
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index i = 0; i + 1 < n; ++i) {
        const double f = weight * 0.5 * (d[static_cast<std::size_t>(i)] + d[static_cast<std::size_t>(i) + 1]);
        out(i, i) += f;
        out(i + 1, i + 1) += f;
        out(i, i + 1) -= f;
        out(i + 1, i) -= f;
    }
    return out;
}

/// Π_a (I + c Σ_q L_{d_q,a} L_a^q)^{-1} v, x first.
inline Values solve_lines(const Oracle& oracle, const std::vector<LineTerm>& terms, const Vec3d& weights,
                          double c, Values v) {
    for (int a = 0; a < 3; ++a) {
        openvdb::Coord step(0, 0, 0);
        step[a] = 1;
        for (std::size_t first = 0; first < oracle.size(); ++first) {
            if (oracle.number(oracle.voxel(first) - step) != Oracle::none) continue;
            std::vector<std::size_t> run;
            openvdb::Coord at = oracle.voxel(first);
            for (int i = oracle.number(at); i != Oracle::none; i = oracle.number(at)) {
                run.push_back(static_cast<std::size_t>(i));
                at += step;
            }
            const auto n = static_cast<Eigen::Index>(run.size());
            Eigen::MatrixXd m = Eigen::MatrixXd::Identity(n, n);
            for (const LineTerm& t : terms) {
                std::vector<double> d;
                for (const std::size_t i : run) d.push_back(t.d[i]);
                Eigen::MatrixXd power = line_flux(d, weights[a]);
                for (int q = 0; q < t.order; ++q)
                    power = (power * line_flux(std::vector<double>(run.size(), 1.0), weights[a])).eval();
                m += c * t.factor * power;
            }
            Eigen::VectorXd x(n);
            for (Eigen::Index i = 0; i < n; ++i) x[i] = v[run[static_cast<std::size_t>(i)]];
            x = m.partialPivLu().solve(x).eval();
            for (Eigen::Index i = 0; i < n; ++i) v[run[static_cast<std::size_t>(i)]] = x[i];
        }
    }
    return v;
}

}  // namespace vdbgeo::test
