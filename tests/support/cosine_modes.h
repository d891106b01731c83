// Eigenvectors of the Laplacian of a box without flux through its faces: products of cosines.
#pragma once

#include <openvdb/openvdb.h>

#include <cmath>
#include <vector>

#include "tests/support/grids.h"
#include "vdbgeo/core/types.h"
#include "vdbgeo/flow/hyperdiffusion.h"

namespace vdbgeo::test {

/// One mode: k half waves along each axis of a box of n voxels.
struct CosineMode {
    Vec3i k;
    Vec3i n;

    double at(const Vec3i& voxel) const {
        double out = 1;
        for (int a = 0; a < 3; ++a) out *= std::cos(M_PI * k[a] * (voxel[a] + 0.5) / n[a]);
        return out;
    }
    /// Σ_a w_a 2 (1 − cos(π k_a / n_a)).
    double eigenvalue(const Vec3d& weights = Vec3d::Ones()) const {
        double out = 0;
        for (int a = 0; a < 3; ++a) out += weights[a] * 2 * (1 - std::cos(M_PI * k[a] / n[a]));
        return out;
    }
};

/// A box of modes, each times its amplitude.
struct CosineBox {
    Vec3i n;
    openvdb::Coord origin;
    std::vector<CosineMode> modes;

    double sum(const openvdb::Coord& c, const std::vector<double>& amplitudes) const {
        const openvdb::Coord v = c - origin;
        double out = 0;
        for (std::size_t i = 0; i < modes.size(); ++i)
            out += amplitudes[i] * modes[i].at({v.x(), v.y(), v.z()});
        return out;
    }
    openvdb::FloatGrid::Ptr grid() const {
        const std::vector<double> ones(modes.size(), 1.0);
        return box_grid(box_of(origin, n.x(), n.y(), n.z()),
                        [&](const openvdb::Coord& c) { return sum(c, ones); });
    }
    /// The largest |grid − Σ amplitude · mode|.
    double difference(const openvdb::FloatGrid& grid, const std::vector<double>& amplitudes) const {
        double most = 0;
        for (auto it = grid.cbeginValueOn(); it; ++it) {
            const double difference = std::abs(*it - sum(it.getCoord(), amplitudes));
            if (!(difference <= most)) most = difference;
        }
        return most;
    }
};

/// From the smoothest to the roughest, in a box that cuts through several cells.
inline CosineBox cosine_box() {
    CosineBox box{{20, 24, 18}, openvdb::Coord(-7, 19, 55), {}};
    for (const Vec3i& k :
         {Vec3i(1, 0, 0), Vec3i(0, 2, 1), Vec3i(5, 3, 4), Vec3i(10, 12, 9), Vec3i(19, 23, 17)})
        box.modes.push_back({k, box.n});
    return box;
}

}  // namespace vdbgeo::test
