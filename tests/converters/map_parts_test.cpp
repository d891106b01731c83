// A map in a folder of parts: what is in the parts together is the map, whatever it is made of.
#include "converters/map_parts.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/maps.h"
#include "tests/support/temp_folder.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

using namespace vdbgeo;
using openvdb::Coord;
using openvdb::CoordBBox;
using test::read_bytes;
using test::TempFolder;

namespace {

/// A cone along z: inside its band are tiles of 8³ voxels that are not active, on both sides of every border
/// between parts, and at the borders leaves that have tiles below them.
DensityMap cone_with_band() {
    const Vec3i size(70, 69, 300);
    std::vector<float> values;
    for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
            for (int x = 0; x < size.x(); ++x)
                values.push_back(40 - static_cast<float>(std::hypot(x - 35, y - 20) + 0.1 * z));
    SparsifyOptions band;
    band.threshold = 0.0f;
    band.band = 4.0f;
    return test::map_from_values(size, values, Frame(), band);
}

const std::vector<CoordBBox> halves_along_z{{Coord(0), Coord(95, 95, 127)},
                                            {Coord(0, 0, 128), Coord(95, 95, 383)}};
const std::vector<CoordBBox> thirds_along_y{{Coord(0), Coord(95, 31, 383)},
                                            {Coord(0, 32, 0), Coord(95, 63, 383)},
                                            {Coord(0, 64, 0), Coord(95, 95, 383)}};

/// Each part as a member of a team has it: with ghosts.
void write_parts(const DensityMap& map, const std::vector<CoordBBox>& boxes,
                 const std::filesystem::path& folder) {
    std::filesystem::create_directory(folder);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        CoordBBox ghosts = boxes[i];
        ghosts.expand(8);
        const DensityMap part{part_of(*map.grid, ghosts), map.frame, map.statistics};
        write_map_part(part, boxes[i], static_cast<int>(i), folder);
    }
}

}  // namespace

TEST(MapParts, ABandedMapIsWhatItsPartsAreTogether) {
    const DensityMap map = cone_with_band();
    ASSERT_GT(map.grid->tree().getValue(Coord(35, 20, 140)), 0);
    ASSERT_FALSE(map.grid->tree().isValueOn(Coord(35, 20, 140)));
    for (const auto& boxes : {halves_along_z, thirds_along_y}) {
        TempFolder folder;
        write_parts(map, boxes, folder / "a.parts");
        std::uint64_t leaves = 0;
        for (std::size_t i = 0; i < boxes.size(); ++i)
            leaves +=
                read_vdb(folder / ("a.parts/part_000" + std::to_string(i) + ".vdb"))->tree().leafCount();
        EXPECT_EQ(leaves, map.grid->tree().leafCount());
        const MapParts parts(folder / "a.parts");
        EXPECT_EQ(parts.active_voxels(), map.grid->activeVoxelCount());
        write_vdb({map.grid}, folder / "whole.vdb");
        parts.write_vdb(folder / "parts.vdb", {}, 1 << 20, folder.path());
        EXPECT_TRUE(read_bytes(folder / "whole.vdb") == read_bytes(folder / "parts.vdb"));
        write_mrc(map, folder / "whole.mrc");
        parts.write_mrc(folder / "parts.mrc");
        EXPECT_TRUE(read_bytes(folder / "whole.mrc") == read_bytes(folder / "parts.mrc"));
    }
}

TEST(MapParts, ALargeTileIsCutByTheBorders) {
    DensityMap map = test::map_from_values(Vec3i(8, 8, 8), std::vector<float>(512, 1.0f));
    map.frame.size = Vec3i(128, 128, 256);
    store_frame(map);
    map.grid->tree().addTile(2, Coord(0), 5, false);
    map.grid->tree().addTile(2, Coord(0, 0, 128), 7, true);
    TempFolder folder;
    const std::vector<CoordBBox> boxes{{Coord(0), Coord(127, 63, 255)},
                                       {Coord(0, 64, 0), Coord(127, 127, 255)}};
    std::filesystem::create_directory(folder / "a.parts");
    for (int i = 0; i < 2; ++i)
        write_map_part(map, boxes[static_cast<std::size_t>(i)], i, folder / "a.parts");
    const auto first = read_vdb(folder / "a.parts/part_0000.vdb");
    const auto second = read_vdb(folder / "a.parts/part_0001.vdb");
    for (const auto& [at, value] : {std::pair(Coord(3, 63, 9), 5.0f), {Coord(127, 0, 255), 7.0f}}) {
        EXPECT_EQ(first->tree().getValue(at), value) << at;
        EXPECT_EQ(second->tree().getValue(at.offsetBy(0, 64, 0)), value) << at;
        EXPECT_EQ(second->tree().getValue(at), map.grid->background()) << at;
    }
    EXPECT_EQ(MapParts(folder / "a.parts").active_voxels(), 128u * 128 * 128);
}
