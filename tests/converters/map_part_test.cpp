// Parts of grids in VDB files: what read_map gives of them, without the rest being read.
#include "converters/map_part.h"

#include <gtest/gtest.h>

#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "tests/support/thread_team.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

using namespace vdbgeo;
using openvdb::Coord;
using openvdb::CoordBBox;
using test::TempFolder;

namespace {

/// Leaves with noise, of which some voxels are kept, and tiles on all levels, active and not.
DensityMap map_with_tiles() {
    SparsifyOptions some;
    some.threshold = 0.2f;
    const Vec3i size(300, 140, 270);
    DensityMap map = test::map_from_values(Vec3i(50, 140, 33), test::noise(50 * 140 * 33, 7), Frame(), some);
    map.frame.size = size;
    store_frame(map);
    map.grid->tree().addTile(1, Coord(64, 24, 40), 5, true);
    map.grid->tree().addTile(1, Coord(64, 32, 40), 6, false);
    map.grid->tree().addTile(2, Coord(128, 0, 128), 7, false);
    return map;
}

void expect_same_part(const MapFile& part, const MapFile& whole, const CoordBBox& box) {
    const auto expected = part_of(*whole.map.grid, box);
    EXPECT_EQ(part.map.grid->tree().leafCount(), expected->tree().leafCount());
    EXPECT_EQ(part.map.grid->activeVoxelCount(), expected->activeVoxelCount());
    EXPECT_EQ(part.map.grid->tree().hasActiveTiles(), false);
    const auto found = part.map.grid->getConstAccessor(), wanted = expected->getConstAccessor();
    for (auto at = box.begin(); at; ++at) {
        ASSERT_EQ(found.getValue(*at), wanted.getValue(*at)) << *at;
        ASSERT_EQ(found.isValueOn(*at), wanted.isValueOn(*at)) << *at;
    }
    EXPECT_EQ(part.map.frame.size, whole.map.frame.size);
    EXPECT_EQ(part.map.grid->transform(), whole.map.grid->transform());
    EXPECT_EQ(part.map.statistics.mean, whole.map.statistics.mean);
    EXPECT_EQ(part.map.statistics.rms, whole.map.statistics.rms);
    EXPECT_EQ(part.map.statistics.count, whole.map.statistics.count);
    EXPECT_EQ(part.map.grid->metaCount(), whole.map.grid->metaCount());
    EXPECT_EQ(part.warnings, whole.warnings);
}

}  // namespace

TEST(MapPart, OfAGridHasTheLeavesAndTilesOfItsBox) {
    TempFolder folder;
    write_vdb({map_with_tiles().grid}, folder / "a.vdb");
    const MapFile whole = read_map(folder / "a.vdb");
    EXPECT_EQ(map_frame(folder / "a.vdb").size, Vec3i(300, 140, 270));
    for (const CoordBBox& box :
         {CoordBBox(Coord(-8), Coord(71, 40, 48)), CoordBBox(Coord(40, 24, 0), Coord(71, 103, 47)),
          CoordBBox(Coord(100, 100, 100), Coord(160, 135, 140)),
          CoordBBox(Coord(270, 0, 0), Coord(311, 47, 47))})
        test::ThreadTeam(1).run([&](Team& team) {
            expect_same_part(read_map_part(folder / "a.vdb", {}, {&team, box, box}), whole, box);
        });
}

TEST(MapPart, OfAGridWithoutABoxIsRefused) {
    TempFolder folder;
    auto grid = openvdb::FloatGrid::create(-1);
    grid->tree().setValue(Coord(1, 2, 3), 4);
    write_vdb({grid}, folder / "a.vdb");
    EXPECT_THROW(map_frame(folder / "a.vdb"), InvalidInput);
}
