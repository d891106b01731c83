// Maps whose surfaces are extracted in parts, and what puts the parts together.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/surface_parts.h"

namespace vdbgeo::test {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

struct Case {
    DensityMap map;
    CoordBBox box;  ///< what is shared out
    double isovalue = 0;
};

inline const Vec3i dense_size(37, 170, 290);

inline CoordBBox box_of_frame(const Frame& frame) {
    return {Coord(0), Coord(frame.size.x() - 1, frame.size.y() - 1, frame.size.z() - 1)};
}

inline Case of_values(const std::vector<float>& values, double isovalue, const Frame& frame = {}) {
    Case c{map_from_values(dense_size, values, frame), {}, isovalue};
    c.box = box_of_frame(c.map.frame);
    return c;
}

/// Every second edge is crossed: faces of all kinds, and tunnels.
inline Case noise() {
    std::vector<float> values = noise(static_cast<std::size_t>(dense_size.prod()), 3);
    values[12345] = std::numeric_limits<float>::quiet_NaN();
    values[77777] = std::numeric_limits<float>::infinity();
    return of_values(values, 0);
}

inline Case mirrored_and_skewed() {
    Frame frame;
    frame.axes << 1.1, 0.3, -0.2, 0.05, -0.9, 0.4, 0.1, 0.2, 1.3;
    frame.origin = Vec3d(10, -200, 31.5);
    return of_values(noise(static_cast<std::size_t>(dense_size.prod()), 4), 0.8, frame);
}

/// A band around the surface of an ellipsoid, tiles inside.
inline Case banded() {
    const Vec3i size(90, 175, 300);
    Frame frame;
    frame.axes = 0.7 * Mat3d::Identity();
    SparsifyOptions options;
    options.threshold = 0;
    options.band = 0.08f;
    const auto f = [&](const Vec3d& p) {
        const Vec3d at = (p / 0.7 - 0.5 * size.cast<double>()).cwiseQuotient(0.47 * size.cast<double>());
        return 1 - at.norm() + 0.03 * std::sin(p.x()) * std::cos(p.y());
    };
    Case c{map_from_function(size, frame, f, options), {}, 0};
    c.box = box_of_frame(c.map.frame);
    return c;
}

/// A noisy ball with holes, at negative indices too, and an active tile in it.
inline Case ball() {
    const CoordBBox box(Coord(-20, -40, -60), Coord(90, 110, 200));
    SparseMaker make(7);
    auto grid = make.grid();
    auto to = grid->getAccessor();
    for (auto c = box.begin(); c; ++c) {
        const Coord at = *c;
        const double r = Vec3d(at.x() - 30, at.y() - 35, 0.6 * (at.z() - 70)).norm();
        if (r > 75 || (r < 12 && at.x() > 30)) continue;
        if (r > 68 && make.uniform() < 0.5) continue;
        to.setValueOn(at, static_cast<float>((r < 45 ? 1 : 0) + make.uniform() - 0.5 + 10));
    }
    grid->tree().addTile(1, Coord(24, 24, 120), 8, true);
    return {{grid, Frame{}, {}}, box, 10.2};
}

/// Constant blocks of 8³ and 128³ voxels that begin where the box does: the surface runs outside of it.
inline Case tiles() {
    const CoordBBox box(Coord(-16, -96, -128), Coord(135, 150, 255));
    auto grid = FloatGrid::create(-1);
    grid->sparseFill(box, 1, false);
    EXPECT_GT(grid->tree().nodeCount()[1], 0u);
    return {{grid, Frame{}, {}}, box, 0.25};
}

/// Crossed nowhere.
inline Case nothing() { return of_values(noise(static_cast<std::size_t>(dense_size.prod()), 5), 2); }

struct Named {
    const char* name;
    Case (*make)();
};
constexpr Named cases[] = {{"noise", noise},   {"mirrored", mirrored_and_skewed},
                           {"banded", banded}, {"ball", ball},
                           {"tiles", tiles},   {"nothing", nothing}};

/// A mesh that comes in runs.
class Assembled {
 public:
    Assembled(std::uint64_t vertices, std::uint64_t triangles)
        : points_(vertices, Vec3f::Constant(-1e9f)), triangles_(triangles, Triangle{}) {}

    void add(const SurfacePiece& piece) {
        put(piece.points, piece.point_runs, points_, points_seen_);
        put(piece.triangles, piece.triangle_runs, triangles_, triangles_seen_);
    }
    void expect_equal(const TriMesh& whole) const {
        ASSERT_EQ(points_.size(), whole.points.size());
        ASSERT_EQ(triangles_.size(), whole.triangles.size());
        EXPECT_EQ(points_seen_, points_.size());
        EXPECT_EQ(triangles_seen_, triangles_.size());
        EXPECT_TRUE(same(points_, whole.points));
        EXPECT_TRUE(same(triangles_, whole.triangles));
    }

 private:
    template <class T, class List>
    static void put(const List& from, const std::vector<SurfaceRun>& runs, std::vector<T>& to,
                    std::uint64_t& seen) {
        std::uint64_t at = 0;
        for (const SurfaceRun& run : runs) {
            ASSERT_LE(run.first + run.count, to.size());
            ASSERT_LE(at + run.count, from.size());
            std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(at), run.count,
                        to.begin() + static_cast<std::ptrdiff_t>(run.first));
            at += run.count;
        }
        EXPECT_EQ(at, from.size());
        seen += at;
    }
    template <class T, class List>
    static bool same(const std::vector<T>& a, const List& b) {
        return a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
    }

    std::vector<Vec3f> points_;
    std::vector<Triangle> triangles_;
    std::uint64_t points_seen_ = 0, triangles_seen_ = 0;
};

inline const std::pair<Case, TriMesh>& in_one(const Named& named) {
    static std::map<std::string, std::pair<Case, TriMesh>> made;
    const auto found = made.find(named.name);
    if (found != made.end()) return found->second;
    Case c = named.make();
    TriMesh mesh = marching_cubes(c.map, {c.isovalue});
    EXPECT_EQ(mesh.empty(), std::string(named.name) == "nothing");
    return made[named.name] = {std::move(c), std::move(mesh)};
}

}  // namespace vdbgeo::test
