// Marching cubes by a team, and part after part, gives the bytes of the whole map's mesh.
#include "vdbgeo/blocks/team_marching_cubes.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>
#include <string>

#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/support/thread_team.h"
#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

struct Case {
    DensityMap map;
    CoordBBox box;  ///< what is shared out
    double isovalue = 0;
};

const Vec3i dense_size(37, 170, 290);

CoordBBox box_of_frame(const Frame& frame) {
    return {Coord(0), Coord(frame.size.x() - 1, frame.size.y() - 1, frame.size.z() - 1)};
}

Case of_values(const std::vector<float>& values, double isovalue, const Frame& frame = {}) {
    Case c{test::map_from_values(dense_size, values, frame), {}, isovalue};
    c.box = box_of_frame(c.map.frame);
    return c;
}

/// Every second edge is crossed: faces of all kinds, and tunnels.
Case noise() {
    std::vector<float> values = test::noise(static_cast<std::size_t>(dense_size.prod()), 3);
    values[12345] = std::numeric_limits<float>::quiet_NaN();
    values[77777] = std::numeric_limits<float>::infinity();
    return of_values(values, 0);
}

Case mirrored_and_skewed() {
    Frame frame;
    frame.axes << 1.1, 0.3, -0.2, 0.05, -0.9, 0.4, 0.1, 0.2, 1.3;
    frame.origin = Vec3d(10, -200, 31.5);
    return of_values(test::noise(static_cast<std::size_t>(dense_size.prod()), 4), 0.8, frame);
}

/// A band around the surface of an ellipsoid, tiles inside.
Case banded() {
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
    Case c{test::map_from_function(size, frame, f, options), {}, 0};
    c.box = box_of_frame(c.map.frame);
    return c;
}

/// A noisy ball with holes, at negative indices too, and an active tile in it.
Case ball() {
    const CoordBBox box(Coord(-20, -40, -60), Coord(90, 110, 200));
    test::SparseMaker make(7);
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
Case tiles() {
    const CoordBBox box(Coord(-16, -96, -128), Coord(135, 150, 255));
    auto grid = FloatGrid::create(-1);
    grid->sparseFill(box, 1, false);
    EXPECT_GT(grid->tree().nodeCount()[1], 0u);
    return {{grid, Frame{}, {}}, box, 0.25};
}

/// Crossed nowhere.
Case nothing() { return of_values(test::noise(static_cast<std::size_t>(dense_size.prod()), 5), 2); }

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

const std::pair<Case, TriMesh>& in_one(const Named& named) {
    static std::map<std::string, std::pair<Case, TriMesh>> made;
    const auto found = made.find(named.name);
    if (found != made.end()) return found->second;
    Case c = named.make();
    TriMesh mesh = marching_cubes(c.map, {c.isovalue});
    EXPECT_EQ(mesh.empty(), std::string(named.name) == "nothing");
    return made[named.name] = {std::move(c), std::move(mesh)};
}

DensityMap part_map(const DensityMap& map, const CoordBBox& box) {
    return {part_of(*map.grid, box), map.frame, map.statistics};
}

class TeamMarchingCubes : public ::testing::TestWithParam<std::pair<int, int>> {};

TEST_P(TeamMarchingCubes, HasTheBytesOfTheWhole) {
    for (const Named& named : cases) {
        SCOPED_TRACE(named.name);
        const auto& [c, whole] = in_one(named);
        const auto boxes = partition(c.box, GetParam());
        Assembled mesh(whole.points.size(), whole.triangles.size());
        std::mutex mutex;
        test::ThreadTeam(static_cast<int>(boxes.size())).run([&, &c = c, &whole = whole](Team& team) {
            const stencil::Share share{&team, boxes, 8};
            const DensityMap part = part_map(c.map, share.with_ghosts(team.rank()));
            const TeamSurface mine = team_marching_cubes(part, {c.isovalue}, share);
            const std::lock_guard<std::mutex> lock(mutex);
            EXPECT_EQ(mine.vertices, whole.points.size());
            EXPECT_EQ(mine.triangles, whole.triangles.size());
            mesh.add(mine.piece);
        });
        mesh.expect_equal(whole);
    }
}

/// Each part is made twice: to be counted, and to be filled in small pieces.
TEST_P(TeamMarchingCubes, OnePartAfterAnotherDoesToo) {
    for (const Named& named : cases) {
        SCOPED_TRACE(named.name);
        const auto& [c, whole] = in_one(named);
        const auto boxes = partition(c.box, GetParam());
        const auto own = without_border(boxes);
        const auto isovalue = static_cast<float>(c.isovalue);
        const auto part = [&, &c = c](std::size_t p) {
            CoordBBox box = boxes[p];
            box.expand(8);
            return part_map(c.map, box);
        };
        std::vector<SurfaceColumn> columns;
        std::vector<BorderBlock> border;
        for (std::size_t p = 0; p < boxes.size(); ++p) {
            const DensityMap map = part(p);
            const SurfacePart surface(map, isovalue, own[p]);
            for (const SurfaceColumn& column : surface.columns()) columns.push_back(column);
            for (const BorderBlock& block : surface.border()) border.push_back(block);
        }
        const SurfaceNumbers numbers(columns);
        Assembled mesh(numbers.vertices(), numbers.triangles());
        constexpr std::size_t bytes = 1 << 20;
        std::size_t pieces = 0;
        for (std::size_t p = 0; p < boxes.size(); ++p) {
            const DensityMap map = part(p);
            SurfacePart surface(map, isovalue, own[p]);
            surface.number(numbers, border);
            surface.fill(bytes, [&](const SurfacePiece& piece) {
                ++pieces;
                mesh.add(piece);
                EXPECT_LT(piece.points.size() * sizeof(Vec3f) + piece.triangles.size() * sizeof(Triangle),
                          3 * bytes);
            });
        }
        EXPECT_GE(pieces, (whole.points.size() + whole.triangles.size()) * sizeof(Vec3f) / (3 * bytes));
        mesh.expect_equal(whole);
    }
}

INSTANTIATE_TEST_SUITE_P(Shares, TeamMarchingCubes,
                         ::testing::Values(std::pair(1, 1), std::pair(2, 1), std::pair(1, 2), std::pair(3, 2),
                                           std::pair(6, 3)),
                         [](const auto& p) {
                             return std::to_string(p.param.first) + "_by_" + std::to_string(p.param.second);
                         });

/// Blocks whose lowest layer along y has crossed edges go to the member below, once.
TEST(TeamMarchingCubesTraffic, IsTheCrossedBlocksAtTheBorder) {
    const auto& [c, whole] = in_one(cases[2]);
    const auto boxes = partition(c.box, {2, 1});
    const int y = boxes[1].min().y();
    const auto samples = c.map.grid->getConstAccessor();
    const Vec3i size = c.map.frame.size;
    const auto crossed = [&](const Coord& a, const Coord& b) {
        for (int k = 0; k < 3; ++k)
            if (b[k] >= size[k]) return false;
        return (samples.getValue(a) >= 0) != (samples.getValue(b) >= 0);
    };
    std::uint64_t blocks = 0;
    for (int x = 0; x < size.x(); x += 8)
        for (int z = 0; z < size.z(); z += 8) {
            bool any = false;
            for (int i = x; i < std::min(x + 8, size.x()); ++i)
                for (int k = z; k < std::min(z + 8, size.z()); ++k) {
                    const Coord at(i, y, k);
                    any = any || crossed(at, at.offsetBy(1, 0, 0)) || crossed(at, at.offsetBy(0, 1, 0)) ||
                          crossed(at, at.offsetBy(0, 0, 1));
                }
            blocks += any;
        }
    EXPECT_GT(blocks, 0u);
    test::ThreadTeam(2).run([&, &c = c](Team& team) {
        const stencil::Share share{&team, boxes, 8};
        const DensityMap part = part_map(c.map, share.with_ghosts(team.rank()));
        const TeamSurface mine = team_marching_cubes(part, {c.isovalue}, share);
        EXPECT_EQ(mine.bytes_sent, team.rank() == 1 ? blocks * sizeof(BorderBlock) : 0u);
    });
}

TEST(TeamMarchingCubesErrors, AreToldByAll) {
    const auto told_by = [](const DensityMap& map, const CoordBBox& box, double isovalue, int halo) {
        std::atomic<int> members{0};
        test::ThreadTeam(2).run([&](Team& team) {
            const stencil::Share share{&team, partition(box, {2, 1}), halo};
            const DensityMap part = part_map(map, share.with_ghosts(team.rank()));
            try {
                team_marching_cubes(part, {isovalue}, share);
            } catch (const InvalidInput&) {
                ++members;
            }
        });
        return members.load();
    };
    const auto& [c, whole] = in_one(cases[3]);
    EXPECT_EQ(told_by(c.map, c.box, std::nan(""), 8), 2);
    EXPECT_EQ(told_by(c.map, c.box, 1e300, 8), 2);
    EXPECT_EQ(told_by(c.map, c.box, 10, 0), 2);
    EXPECT_EQ(told_by(c.map, c.box, 10, 16), 0);
    // A voxel too near to the end of the indices, in one part.
    constexpr int end = std::numeric_limits<int>::max();
    const auto grid = test::empty_grid();
    grid->tree().setValueOn(Coord(end - 200, 100, 0), 1);
    EXPECT_EQ(told_by({grid, Frame{}, {}}, {Coord(0), Coord(end - 192, 127, 127)}, 0, 8), 2);
    // Nothing at all is nothing to do.
    EXPECT_EQ(told_by({test::empty_grid(), Frame{}, {}}, c.box, 0, 8), 0);
    // Neither is a map of one layer, which has no cells.
    DensityMap thin = c.map;
    thin.frame.size = Vec3i(1, 200, 200);
    EXPECT_EQ(told_by(thin, c.box, 10, 8), 0);
}

}  // namespace
}  // namespace vdbgeo
