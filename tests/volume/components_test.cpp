#include "vdbgeo/volume/components.h"

#include <gtest/gtest.h>
#include <openvdb/tools/Morphology.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::MaskTree;
using Voxels = std::set<Coord>;

const CoordBBox everywhere(Coord(-100000), Coord(100000));

MaskTree mask_of(const Voxels& voxels) {
    MaskTree mask;
    for (const Coord& v : voxels) mask.setValueOn(v);
    return mask;
}

Voxels voxels_of(const MaskTree& mask) {
    Voxels voxels;
    for (auto v = mask.cbeginValueOn(); v; ++v)
        for (auto c = v.getBoundingBox().begin(); c; ++c) voxels.insert(*c);
    return voxels;
}

/// Each voxel of a box with probability `density`.
Voxels noise(const CoordBBox& box, double density, unsigned seed) {
    std::mt19937 random(seed);
    Voxels voxels;
    for (auto c = box.begin(); c; ++c)
        if (random() < density * 4294967296.0) voxels.insert(*c);
    return voxels;
}

/// Components by flood fill.
std::vector<Voxels> components_of(Voxels voxels) {
    std::vector<Voxels> components;
    while (!voxels.empty()) {
        std::vector<Coord> open{*voxels.begin()};
        voxels.erase(voxels.begin());
        components.emplace_back();
        while (!open.empty()) {
            const Coord c = open.back();
            open.pop_back();
            components.back().insert(c);
            for (int axis = 0; axis < 3; ++axis)
                for (const int step : {-1, 1}) {
                    Coord beside = c;
                    beside[axis] += step;
                    if (voxels.erase(beside)) open.push_back(beside);
                }
        }
    }
    return components;
}

std::vector<std::uint64_t> sizes_of(const std::vector<Voxels>& components) {
    std::vector<std::uint64_t> sizes;
    for (const Voxels& c : components) sizes.push_back(c.size());
    std::sort(sizes.rbegin(), sizes.rend());
    return sizes;
}

void expect_as_brute_force(const Voxels& voxels, const std::vector<std::uint64_t>& limits) {
    const std::vector<Voxels> components = components_of(voxels);
    EXPECT_EQ(component_sizes(mask_of(voxels)), sizes_of(components));
    for (const std::uint64_t limit : limits) {
        Voxels kept;
        for (const Voxels& c : components)
            if (c.size() >= limit) kept.insert(c.begin(), c.end());
        MaskTree mask = mask_of(voxels);
        EXPECT_EQ(remove_small_components(mask, limit), voxels.size() - kept.size()) << limit;
        EXPECT_EQ(voxels_of(mask), kept) << limit;
        EXPECT_EQ(mask.activeVoxelCount(), kept.size()) << limit;
    }
}

TEST(Components, NoiseAsByFloodFill) {
    // Across borders of leaves, of blocks of 128³ and of the tree's quadrants; near the percolation threshold
    // too.
    const std::vector<CoordBBox> boxes{
        {Coord(-9, -13, -11), Coord(12, 9, 10)},      {Coord(118, 120, 121), Coord(137, 140, 139)},
        {Coord(-5, 119, 4088), Coord(14, 138, 4103)}, {Coord(0, 0, -140), Coord(3, 5, 280)},
        {Coord(-140, 0, 0), Coord(130, 4, 4)},
    };
    unsigned seed = 0;
    for (const CoordBBox& box : boxes)
        for (const double density : {0.05, 0.2, 0.31, 0.5, 0.9}) {
            SCOPED_TRACE(testing::Message() << box << " " << density);
            expect_as_brute_force(noise(box, density, ++seed), {0, 1, 2, 3, 7, 40, 1000});
        }
}

TEST(Components, CheckerboardIsAllDust) {
    Voxels board;
    for (auto c = CoordBBox(Coord(-20), Coord(19)).begin(); c; ++c)
        if (((*c).x() + (*c).y() + (*c).z()) % 2 == 0) board.insert(*c);
    MaskTree mask = mask_of(board);
    EXPECT_EQ(component_sizes(mask), std::vector<std::uint64_t>(board.size(), 1));
    EXPECT_EQ(remove_small_components(mask, 2), board.size());
    EXPECT_TRUE(mask.empty());
}

TEST(Components, SnakeThroughManyBlocks) {
    // One voxel thick, to and fro along y and z: it joins only at its turns.
    Voxels snake;
    const int length = 300;
    for (int x = -6; x <= 6; x += 2) {
        for (int z = -length; z <= length; ++z) snake.insert(Coord(x, 127, z));
        if (x < 6) snake.insert(Coord(x + 1, 127, (x / 2) % 2 == 0 ? length : -length));
    }
    MaskTree mask = mask_of(snake);
    mask.setValueOn(Coord(-7, 126, 0));  // touches by an edge only
    EXPECT_EQ(component_sizes(mask), (std::vector<std::uint64_t>{snake.size(), 1}));
    EXPECT_EQ(remove_small_components(mask, snake.size()), 1u);
    EXPECT_EQ(voxels_of(mask), snake);
    EXPECT_EQ(remove_small_components(mask, snake.size() + 1), snake.size());
    EXPECT_TRUE(mask.empty());
}

TEST(Components, TilesCountAsTheirVoxels) {
    MaskTree mask;
    mask.addTile(1, Coord(-8, 0, 0), true, true);             // 8³
    mask.addTile(2, Coord(128, 0, 0), true, true);            // 128³
    mask.addTile(3, Coord(-4096, -4096, -4096), true, true);  // 4096³, which touches the first by an edge
    mask.setValueOn(Coord(127, 5, 5));                        // touches the second
    mask.setValueOn(Coord(-9, -1, -1));                       // in the third
    mask.setValueOn(Coord(0, 7, 7));                          // touches the first
    const std::uint64_t block = 128 * 128 * 128, root = block * 32768;
    EXPECT_EQ(component_sizes(mask), (std::vector<std::uint64_t>{root, block + 1, 513}));
    EXPECT_EQ(remove_small_components(mask, 513), 0u);
    EXPECT_EQ(remove_small_components(mask, 514), 513u);
    EXPECT_FALSE(mask.isValueOn(Coord(-8, 0, 0)));
    EXPECT_EQ(remove_small_components(mask, block + 2), block + 1);
    EXPECT_FALSE(mask.isValueOn(Coord(200, 100, 100)));
    EXPECT_EQ(mask.activeVoxelCount(), root);
    EXPECT_EQ(remove_small_components(mask, root + 1), root);
    EXPECT_TRUE(mask.empty());
}

TEST(Components, NothingToDo) {
    MaskTree mask;
    EXPECT_TRUE(component_sizes(mask).empty());
    EXPECT_EQ(remove_small_components(mask, 100), 0u);
    mask.setValueOn(Coord(1, 2, 3));
    EXPECT_EQ(remove_small_components(mask, 0), 0u);
    EXPECT_EQ(remove_small_components(mask, 1), 0u);
    EXPECT_TRUE(mask.isValueOn(Coord(1, 2, 3)));
}

TEST(Components, AnyNumberOfThreads) {
    const Voxels voxels = noise(CoordBBox(Coord(-40, 100, -160), Coord(20, 160, 160)), 0.25, 11);
    std::vector<std::vector<std::uint64_t>> sizes;
    std::vector<Voxels> left, grown;
    for (const std::size_t threads : {1, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        MaskTree mask = mask_of(voxels);
        sizes.push_back(component_sizes(mask));
        remove_small_components(mask, 6);
        left.push_back(voxels_of(mask));
        grow(mask, 1, everywhere);
        grown.push_back(voxels_of(mask));
    }
    EXPECT_EQ(sizes[0], sizes[1]);
    EXPECT_EQ(left[0], left[1]);
    EXPECT_EQ(grown[0], grown[1]);
    EXPECT_LT(left[0].size(), voxels.size());
}

TEST(Components, Cancelled) {
    MaskTree mask = mask_of(noise(CoordBBox(Coord(0), Coord(20)), 0.2, 3));
    EXPECT_THROW(remove_small_components(mask, 5, Progress([](double) { return false; })), Cancelled);
}

Voxels grown_by_hand(const Voxels& voxels, int n, const CoordBBox& box) {
    Voxels result;
    for (const Coord& v : voxels)
        for (auto c = CoordBBox(v.offsetBy(-n), v.offsetBy(n)).begin(); c; ++c)
            if (box.isInside(*c)) result.insert(*c);
    return result;
}

TEST(Grow, AsByHand) {
    const std::vector<CoordBBox> boxes{{Coord(-9, -13, -11), Coord(12, 9, 10)},
                                       {Coord(118, 120, 121), Coord(137, 140, 139)},
                                       {Coord(-3, 4090, -130), Coord(4, 4099, -125)}};
    unsigned seed = 0;
    for (const CoordBBox& box : boxes)
        for (const double density : {0.001, 0.01, 0.3})
            for (const int n : {0, 1, 2, 5, 8, 9, 17}) {
                if (density > 0.1 && n > 2) continue;  // slow by hand, and full anyway
                SCOPED_TRACE(testing::Message() << box << " " << density << " " << n);
                const Voxels voxels = noise(box, density, ++seed);
                // Clipped on some sides, and not on others.
                const CoordBBox clip(box.min().offsetBy(-30, 2, -4), box.max().offsetBy(3, 40, -5));
                MaskTree mask = mask_of(voxels);
                grow(mask, n, clip);
                EXPECT_EQ(voxels_of(mask), grown_by_hand(voxels, n, clip));
            }
}

TEST(Grow, AsOpenVdbDoes) {
    MaskTree mask = mask_of(noise(CoordBBox(Coord(-70), Coord(70)), 0.0005, 5));
    mask.addTile(2, Coord(128, 128, 0), true, true);
    MaskTree peer = mask;
    grow(mask, 6, everywhere);
    openvdb::tools::dilateActiveValues(peer, 6, openvdb::tools::NN_FACE_EDGE_VERTEX);
    EXPECT_EQ(mask.activeVoxelCount(), peer.activeVoxelCount());
    MaskTree both = mask;
    both.topologyIntersection(peer);
    EXPECT_EQ(both.activeVoxelCount(), peer.activeVoxelCount());
}

TEST(Grow, EmptyAndWrong) {
    MaskTree mask;
    grow(mask, 3, everywhere);
    EXPECT_TRUE(mask.empty());
    mask.setValueOn(Coord(5));
    EXPECT_THROW(grow(mask, -1, everywhere), InvalidInput);
    grow(mask, 3, CoordBBox(Coord(100), Coord(200)));
    EXPECT_TRUE(mask.empty());
}

}  // namespace
}  // namespace vdbgeo
