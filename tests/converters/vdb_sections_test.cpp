// Grids into map files without being loaded: the bytes are those of read_vdb and write_mrc.
#include "converters/vdb_sections.h"

#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <fstream>

#include "converters/map_file.h"
#include "converters/vdb_file.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::Coord;
using openvdb::FloatGrid;
using test::read_bytes;
using test::TempFolder;
using Compression = VdbWriteOptions::Compression;

namespace {

void expect_same_file(const std::filesystem::path& vdb, const MrcWriteOptions& options = {},
                      const std::optional<std::string>& name = {}) {
    TempFolder folder;
    const FloatGrid::Ptr grid = read_vdb(vdb, name);
    const MrcWriteReport loaded = write_mrc(map_from_grid(grid), folder / "loaded.mrc", options);
    const VdbSections source(vdb, name);
    const MrcWriteReport streamed = write_mrc(source, folder / "streamed.mrc", options);
    EXPECT_TRUE(read_bytes(folder / "loaded.mrc") == read_bytes(folder / "streamed.mrc")) << vdb;
    EXPECT_EQ(loaded.largest_error, streamed.largest_error);
    EXPECT_EQ(source.active_voxels(), grid->activeVoxelCount());
    EXPECT_EQ(source.active_box(), grid->evalActiveVoxelBoundingBox());
    EXPECT_EQ(source.leaves(), grid->constTree().leafCount());
    EXPECT_EQ(source.grid().background(), grid->background());
}

DensityMap noise_map(const std::optional<float>& threshold = 0.2f) {
    SparsifyOptions some;
    some.threshold = threshold;
    Frame frame;
    frame.axes = Vec3d(1.5, 2, 2.5).asDiagonal();
    frame.origin = Vec3d(-7, 8, 9);
    return test::map_from_values(Vec3i(150, 41, 33), test::noise(150 * 41 * 33, 7), frame, some);
}

/// Leaves on both sides of zero, tiles on every level, active and not.
FloatGrid::Ptr odd_grid() {
    auto grid = FloatGrid::create(-1);
    grid->setName("odd");
    FloatGrid::TreeType& tree = grid->tree();
    tree.addTile(2, Coord(128, 0, 0), 3, true);
    tree.addTile(2, Coord(-128, 0, 0), 6, false);
    tree.addTile(1, Coord(8, 8, 8), 4, false);
    tree.addTile(1, Coord(-16, -8, 24), 5, true);
    for (int i = 0; i < 200; ++i) tree.setValue(Coord(i - 100, 3 * i % 47 - 20, i * i % 61 - 30), float(i));
    tree.setValueOff(Coord(-3, -3, -3), 9);
    return grid;
}

}  // namespace

TEST(VdbSections, EveryCompressionGivesTheBytesOfTheLoadedGrid) {
    TempFolder folder;
    for (const bool halves : {false, true})
        for (const auto compression : {Compression::none, Compression::zip, Compression::blosc}) {
            VdbWriteOptions options;
            options.compression = compression;
            options.half = halves;
            write_vdb({noise_map().grid}, folder / "a.vdb", options);
            expect_same_file(folder / "a.vdb");
            write_vdb({odd_grid()}, folder / "a.vdb", options);
            expect_same_file(folder / "a.vdb");
        }
}

TEST(VdbSections, EveryOrderOfAxes) {
    TempFolder folder;
    for (const char* axes : {"1,2,3", "1,3,2", "2,1,3", "2,3,1", "3,1,2", "3,2,1"})
        for (const auto& grid : {noise_map().grid, odd_grid()}) {
            grid->insertMeta("mrc_axes", openvdb::StringMetadata(axes));
            write_vdb({grid}, folder / "a.vdb");
            expect_same_file(folder / "a.vdb");
        }
}

TEST(VdbSections, LevelSetsWithTwoInactiveValues) {
    TempFolder folder;
    const auto sphere = openvdb::tools::createLevelSetSphere<FloatGrid>(60, openvdb::Vec3f(1, 2, 3), 1);
    write_vdb({sphere}, folder / "a.vdb");
    expect_same_file(folder / "a.vdb");
}

TEST(VdbSections, AFileWithoutOffsetsAndASharedTree) {
    TempFolder folder;
    {
        std::ofstream out(folder / "pipe.vdb", std::ios::binary);
        openvdb::io::Stream(out).write(openvdb::GridCPtrVec{odd_grid(), noise_map().grid});
    }
    expect_same_file(folder / "pipe.vdb");
    expect_same_file(folder / "pipe.vdb", {}, "odd");
    const auto first = noise_map().grid;
    const auto second =
        openvdb::GridBase::grid<FloatGrid>(std::const_pointer_cast<openvdb::GridBase>(first->copyGrid()));
    second->setName("moved");
    second->setTransform(openvdb::math::Transform::createLinearTransform(2.5));
    write_vdb({first, second}, folder / "a.vdb");
    expect_same_file(folder / "a.vdb", {}, "moved");
}

TEST(VdbSections, ModesAndScalings) {
    TempFolder folder;
    write_vdb({noise_map().grid}, folder / "a.vdb");
    for (const int mode : {0, 1, 6, 12, 101}) {
        MrcWriteOptions options;
        options.mode = mode;
        options.scaling = MrcWriteOptions::Scaling::automatic;
        expect_same_file(folder / "a.vdb", options);
    }
}

TEST(VdbSections, ForeignFiles) {
    for (const char* name : {"mjurczyk_openvdb/cube.vdb", "mjurczyk_openvdb/smoke.vdb",
                             "mjurczyk_openvdb/sphere.vdb", "tinyvdbio/sphere-div1.vdb", "oiio/sphere.vdb"}) {
        VDBGEO_NEEDS_DATA(name);
        expect_same_file(test::data_folder() / name);
    }
}

TEST(VdbSections, RefusesWhatReadVdbRefuses) {
    TempFolder folder;
    const auto message = [](const auto& open) -> std::string {
        try {
            open();
        } catch (const InvalidInput& e) {
            return e.what();
        }
        return "";
    };
    const auto expect_same = [&](const std::filesystem::path& path) {
        const std::string expected = message([&] { read_vdb(path); });
        EXPECT_EQ(message([&] { VdbSections source(path); }), expected);
        EXPECT_NE(expected, "") << path;
    };
    for (const char* name :
         {"bad-bbox-bomb.vdb", "bad-bbox-empty.vdb", "bad-bbox-huge.vdb", "truncated.vdb"}) {
        VDBGEO_NEEDS_DATA(std::string("oiio_damaged/") + name);
        expect_same(test::data_folder() / "oiio_damaged" / name);
    }
    write_vdb({noise_map().grid}, folder / "a.vdb");
    const std::string good = read_bytes(folder / "a.vdb");
    const std::string name = std::string("xxh3-128 ");
    for (const std::size_t at : {good.size() - 3, good.size() / 2, good.find("file_bbox_max") + 22,
                                 good.find("file_voxel_count") + 29}) {
        std::string bytes = good;
        bytes[at] ^= 1;
        test::write_bytes(folder / "b.vdb", bytes);
        expect_same(folder / "b.vdb");
        bytes[bytes.find(name) + name.size()] ^= 1;  // without the checksum
        test::write_bytes(folder / "b.vdb", bytes);
        if (at < good.size() / 2) expect_same(folder / "b.vdb");
    }
    EXPECT_NE(message([&] { VdbSections source(folder / "a.vdb", "other"); }).find("no grid 'other' among"),
              std::string::npos);
}
