// Parts cover everything once, and are as even as cells allow.
#include "vdbgeo/blocks/partition.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

TEST(Partition, CoversEachUnitOnce) {
    const CoordBBox box(Coord(-40, -33, -129), Coord(100, 250, 300));
    for (const auto& parts : std::vector<std::pair<int, int>>{{1, 1}, {3, 1}, {1, 3}, {4, 2}, {10, 4}}) {
        const auto boxes = partition(box, parts);
        ASSERT_EQ(boxes.size(), static_cast<std::size_t>(parts.first * parts.second));
        std::uint64_t voxels = 0;
        CoordBBox all;
        for (const CoordBBox& b : boxes) {
            EXPECT_EQ(b.min().y() & 7, 0);
            EXPECT_EQ(b.min().z() & 127, 0);
            EXPECT_EQ((b.max().y() + 1) & 7, 0);
            EXPECT_EQ((b.max().z() + 1) & 127, 0);
            voxels += b.volume();
            all.expand(b);
            for (const CoordBBox& other : boxes) EXPECT_TRUE(&b == &other || !b.hasOverlap(other));
        }
        EXPECT_EQ(voxels, all.volume());
        EXPECT_TRUE(all.isInside(box));
    }
}

TEST(Partition, PartsDifferByAUnitAtMost) {
    const CoordBBox box(Coord(0), Coord(9, 1023, 9));
    const auto boxes = partition(box, {7, 1});
    const auto [least, most] =
        std::minmax_element(boxes.begin(), boxes.end(),
                            [](const CoordBBox& a, const CoordBBox& b) { return a.dim().y() < b.dim().y(); });
    EXPECT_EQ(most->dim().y() - least->dim().y(), 8);
}

TEST(Partition, ChoosesTheEvenest) {
    const CoordBBox box(Coord(0), Coord(299, 279, 259));  // 35 × 3 units, the last of z with 4 voxels
    EXPECT_EQ(parts_for(box, 1), std::pair(1, 1));
    EXPECT_EQ(parts_for(box, 2), std::pair(1, 2)) << "128 and 132 sections";
    EXPECT_EQ(parts_for(box, 3), std::pair(3, 1)) << "of 1 x 3 one part would have four sections";
    EXPECT_EQ(parts_for(box, 7), std::pair(7, 1));
    EXPECT_EQ(parts_for(box, 27), std::pair(9, 3)) << "27 parts of one or two leaves are mostly ghosts";
    EXPECT_EQ(parts_for(box, 105), std::pair(35, 3));
    EXPECT_THROW(parts_for(box, 37), InvalidInput);
    EXPECT_THROW(parts_for(box, 106), InvalidInput);
    EXPECT_THROW(partition(box, {36, 1}), InvalidInput);
    EXPECT_THROW(partition(box, {0, 1}), InvalidInput);
}

TEST(Partition, APartHasTheLeavesOfItsBox) {
    const auto grid = test::box_grid(test::box_of(Coord(-20, 0, 0), 60, 70, 30),
                                     [](const Coord& c) { return c.x() + 100 * c.y() + 1e4 * c.z(); });
    grid->tree().addTile(1, Coord(200, 0, 0), 5, true);
    const auto part = part_of(*grid, {Coord(-100, 32, 0), Coord(300, 63, 100)});
    EXPECT_EQ(part->activeVoxelCount(), 60u * 32 * 30);
    for (auto it = part->cbeginValueOn(); it; ++it) EXPECT_EQ(*it, grid->tree().getValue(it.getCoord()));
    const auto other = part_of(*grid, {Coord(150, 0, 0), Coord(300, 31, 100)});
    EXPECT_EQ(other->activeVoxelCount(), 512u);
    EXPECT_EQ(other->tree().leafCount(), 1u);
}

TEST(Partition, APartHasTheInactiveTilesThatTouchItsBox) {
    auto grid = openvdb::FloatGrid::create(-1);
    grid->tree().addTile(1, Coord(0, 24, 0), 5, false);
    grid->tree().addTile(1, Coord(0, 40, 0), 5, false);
    grid->tree().addTile(2, Coord(0, 128, 0), 7, false);
    const auto part = part_of(*grid, {Coord(0), Coord(31)});
    EXPECT_EQ(part->tree().getValue(Coord(7, 31, 0)), 5);
    EXPECT_EQ(part->tree().getValue(Coord(7, 47, 0)), -1);
    EXPECT_EQ(part->tree().getValue(Coord(0, 200, 0)), -1);
    EXPECT_EQ(part->activeVoxelCount(), 0u);
    const auto other = part_of(*grid, {Coord(100), Coord(150)});
    EXPECT_EQ(other->tree().getValue(Coord(100, 151, 100)), 7);
    EXPECT_EQ(other->tree().getValue(Coord(100, 152, 100)), -1);
    EXPECT_EQ(other->tree().getValue(Coord(0, 200, 0)), -1);
}

TEST(Partition, WithoutBorderEveryVoxelLiesInOneBox) {
    const auto boxes = without_border(partition({Coord(-5, -40, 0), Coord(60, 130, 400)}, {3, 2}));
    for (const Coord& at : {Coord(-1000, 0, 0), Coord(0, -5000, 130), Coord(0, 1 << 30, 0),
                            Coord(5, 5, -9000), Coord(1 << 30, 64, 1 << 30), Coord(-5, -40, 0)})
        EXPECT_EQ(std::count_if(boxes.begin(), boxes.end(), [&](const auto& b) { return b.isInside(at); }), 1)
            << at;
}

}  // namespace
}  // namespace vdbgeo
