// Read back with NanoVDB's own reader.
#include <gtest/gtest.h>

#include "converters/map_file.h"
#include "converters/nanovdb_file.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/derivatives.h"
#include "vdbgeo/volume/fog.h"

#ifdef VDBGEO_HAVE_NANOVDB
#include <nanovdb/util/GridValidator.h>
#include <nanovdb/util/IO.h>
#endif

namespace vdbgeo {
namespace {

#ifdef VDBGEO_HAVE_NANOVDB

/// Every voxel of a box, its activity, and where the grid lies.
void expect_equal(const openvdb::FloatGrid& grid, const nanovdb::FloatGrid& read, const Vec3i& size) {
    EXPECT_EQ(read.activeVoxelCount(), grid.activeVoxelCount());
    EXPECT_EQ(read.gridName(), grid.getName());
    EXPECT_EQ(read.tree().background(), grid.background());
    const auto values = read.getAccessor();
    for (int x = -2; x < size.x() + 2; ++x)
        for (int y = -2; y < size.y() + 2; ++y)
            for (int z = -2; z < size.z() + 2; ++z) {
                float value = 0;
                const bool on = values.probeValue(nanovdb::Coord(x, y, z), value);
                ASSERT_EQ(value, grid.tree().getValue(openvdb::Coord(x, y, z))) << x << " " << y << " " << z;
                ASSERT_EQ(on, grid.tree().isValueOn(openvdb::Coord(x, y, z)));
            }
    const auto at = grid.transform().indexToWorld(openvdb::Vec3d(3, 5, 7));
    const auto there = read.indexToWorld(nanovdb::Vec3d(3, 5, 7));
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(at[a], there[a], 1e-9);
}

TEST(NanoVdb, EveryVoxelOfARealMapComesBack) {
    VDBGEO_NEEDS_DATA("ngl/betaGal.mrc");
    const test::TempFolder folder;
    const MapFile in = read_map(test::data_folder() / "ngl/betaGal.mrc");
    const auto fog = fog_volume(in.map);
    write_nanovdb({in.map.grid, fog}, folder / "b.nvdb");
    auto raw = nanovdb::io::readGrid((folder / "b.nvdb").string(), 0);
    auto second = nanovdb::io::readGrid((folder / "b.nvdb").string(), 1);
    ASSERT_TRUE(raw.grid<float>());
    ASSERT_TRUE(second.grid<float>());
    expect_equal(*in.map.grid, *raw.grid<float>(), in.map.frame.size);
    expect_equal(*fog, *second.grid<float>(), in.map.frame.size);
    EXPECT_TRUE(second.grid<float>()->isFogVolume());
    EXPECT_TRUE(nanovdb::isValid(*second.grid<float>(), true));
}

TEST(NanoVdb, VectorsComeBack) {
    const test::TempFolder folder;
    const DensityMap map = test::map_from_function(
        Vec3i(20, 12, 9), {}, [](const Vec3d& p) { return p.x() * p.x() + 2 * p.y() - p.z(); });
    const auto grid = gradient(map);
    write_nanovdb({grid}, folder / "g.nvdb");
    auto handle = nanovdb::io::readGrid((folder / "g.nvdb").string());
    const auto* read = handle.grid<nanovdb::Vec3f>();
    ASSERT_TRUE(read);
    for (auto it = grid->cbeginValueOn(); it; ++it) {
        const auto c = it.getCoord();
        const auto v = read->tree().getValue(nanovdb::Coord(c.x(), c.y(), c.z()));
        ASSERT_EQ(openvdb::Vec3s(v[0], v[1], v[2]), *it);
    }
}

TEST(NanoVdb, TheSameGridGivesTheSameBytes) {
    const test::TempFolder folder;
    const DensityMap map = test::map_from_values(Vec3i(50, 40, 30), test::noise(60000, 5));
    write_nanovdb({map.grid}, folder / "1.nvdb");
    std::vector<char> dirt(1 << 22, 'x');  // memory that is used again is not clean
    dirt.clear();
    dirt.shrink_to_fit();
    write_nanovdb({map.grid}, folder / "2.nvdb");
    EXPECT_TRUE(test::read_bytes(folder / "1.nvdb") == test::read_bytes(folder / "2.nvdb"));
    EXPECT_GT(test::read_bytes(folder / "1.nvdb").size(), 240000u);
}

TEST(NanoVdb, OtherTypesAreRefusedAndLeaveNoFile) {
    const test::TempFolder folder;
    EXPECT_THROW(write_nanovdb({openvdb::Int32Grid::create()}, folder / "i.nvdb"), InvalidInput);
    EXPECT_FALSE(std::filesystem::exists(folder / "i.nvdb"));
    EXPECT_THROW(write_nanovdb({openvdb::FloatGrid::create()}, folder / "none/i.nvdb"), IoError);
}

#else

TEST(NanoVdb, ABuildWithoutItSaysSo) {
    EXPECT_FALSE(have_nanovdb());
    EXPECT_THROW(write_nanovdb({openvdb::FloatGrid::create()}, "x.nvdb"), InvalidInput);
}

#endif

}  // namespace
}  // namespace vdbgeo
