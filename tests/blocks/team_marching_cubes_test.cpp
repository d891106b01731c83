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

#include "tests/blocks/surface_cases.h"
#include "tests/support/thread_team.h"
#include "vdbgeo/blocks/partition.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

using test::Assembled;
using test::cases;
using test::in_one;
using test::Named;

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
