// Level sets of analytic bodies.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>

namespace vdbgeo::test {

/// Middle of the bodies, in voxels: nowhere special on the lattice.
inline const openvdb::Vec3d middle(0.13, -0.21, 0.37);

/// The level set of a signed distance (voxels, from the middle), on a band of `half_width` voxels; the
/// voxel's length is in world units, as the values are.
template <class Distance>
openvdb::FloatGrid::Ptr level_set_of(int reach, const Distance& distance, double half_width = 3,
                                     double voxel = 1) {
    const auto width = static_cast<float>(half_width * voxel);
    auto grid = openvdb::FloatGrid::create(width);
    auto to = grid->getAccessor();
    for (int x = -reach; x <= reach; ++x)
        for (int y = -reach; y <= reach; ++y)
            for (int z = -reach; z <= reach; ++z) {
                const auto d = static_cast<float>(distance(openvdb::Vec3d(x, y, z) - middle) * voxel);
                if (std::abs(d) < width)
                    to.setValue(openvdb::Coord(x, y, z), d);
                else if (d < 0)
                    to.setValueOff(openvdb::Coord(x, y, z), -width);
            }
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
    grid->pruneGrid();
    return grid;
}

inline openvdb::FloatGrid::Ptr sphere(double radius, double half_width = 3, double voxel = 1) {
    return level_set_of(
        static_cast<int>(radius + half_width) + 2,
        [=](const openvdb::Vec3d& p) { return p.length() - radius; }, half_width, voxel);
}

/// Around z; `big` is the radius of the tube's middle line.
inline openvdb::FloatGrid::Ptr torus(double big, double tube, double half_width = 3) {
    return level_set_of(
        static_cast<int>(big + tube + half_width) + 2,
        [=](const openvdb::Vec3d& p) { return std::hypot(std::hypot(p[0], p[1]) - big, p[2]) - tube; },
        half_width);
}

/// body(point) for the crossings of the lattice's edges, from the middle.
template <class Body>
void for_crossings(const openvdb::FloatGrid& grid, const Body& body) {
    auto values = grid.getConstAccessor();
    for (auto it = grid.cbeginValueOn(); it; ++it)
        for (int a = 0; a < 3; ++a) {
            openvdb::Coord next = it.getCoord();
            ++next[a];
            const double u = *it, v = values.getValue(next);
            if ((u < 0) == (v < 0)) continue;
            openvdb::Vec3d p = it.getCoord().asVec3d();
            p[a] += u / (u - v);
            body(p - middle);
        }
}

struct Radii {
    double least = 1e30, most = 0;
    double spread() const { return most - least; }
};

inline Radii radii(const openvdb::FloatGrid& grid) {
    Radii r;
    for_crossings(grid, [&](const openvdb::Vec3d& p) {
        r.least = std::min(r.least, p.length());
        r.most = std::max(r.most, p.length());
    });
    return r;
}

}  // namespace vdbgeo::test
