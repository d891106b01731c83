// Dihedral angles of a tetrahedron, for the tests that do not measure them with what they test.
#pragma once

#include <array>
#include <cmath>

#include "vdbgeo/core/tet_mesh.h"

namespace vdbgeo::test {

/// The six dihedral angles, in degrees; all −1 for a tetrahedron that is turned over.
inline std::array<double, 6> dihedrals(const std::array<Vec3d, 4>& p) {
    std::array<double, 6> out;
    out.fill(-1);
    if (!(tet_determinant(p[0], p[1], p[2], p[3]) > 0)) return out;
    std::size_t n = 0;
    for (const auto& edge : tet_edges) {
        const auto a = static_cast<std::size_t>(edge[0]), b = static_cast<std::size_t>(edge[1]);
        std::array<Vec3d, 2> across;
        std::size_t k = 0;
        for (std::size_t c = 0; c < 4; ++c)
            if (c != a && c != b) {
                const Vec3d along = (p[b] - p[a]).normalized(), to = p[c] - p[a];
                across[k++] = to - along * along.dot(to);
            }
        out[n++] = std::atan2(across[0].cross(across[1]).norm(), across[0].dot(across[1])) * 180 / M_PI;
    }
    return out;
}

}  // namespace vdbgeo::test
