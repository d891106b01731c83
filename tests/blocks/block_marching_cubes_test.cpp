// Marching cubes block after block gives the bytes of the whole map's mesh.
#include "vdbgeo/blocks/block_marching_cubes.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/blocks/surface_cases.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using test::Case;

/// Reads boxes of a map that is in memory, and notes that no two are held at a time.
class Reader {
 public:
    explicit Reader(const DensityMap& map) : map_(map) {}

    ReadBox function() {
        return [this](const CoordBBox& wanted, const Progress&) {
            EXPECT_TRUE(held_.expired()) << "two blocks at a time";
            ++reads_;
            const DensityMap part{part_of(*map_.grid, wanted), map_.frame, map_.statistics};
            held_ = part.grid;
            return part;
        };
    }
    std::size_t reads() const { return reads_; }

 private:
    const DensityMap& map_;
    std::weak_ptr<openvdb::FloatGrid> held_;
    std::size_t reads_ = 0;
};

void expect_same(const Case& c, const TriMesh& whole, const BlockLattice& lattice) {
    Reader reader(c.map);
    BlockMarchingCubes surface(reader.function(), lattice, {c.isovalue});
    EXPECT_EQ(reader.reads(), lattice.size());
    EXPECT_EQ(surface.vertices(), whole.points.size());
    EXPECT_EQ(surface.triangles(), whole.triangles.size());
    test::Assembled mesh(surface.vertices(), surface.triangles());
    surface.fill(1 << 18, [&](const SurfacePiece& piece) { mesh.add(piece); });
    mesh.expect_equal(whole);
    // The last block is still there.
    EXPECT_LE(reader.reads(), 2 * lattice.size() - 1);
}

class Lattices : public ::testing::TestWithParam<Coord> {};

TEST_P(Lattices, GiveTheBytesOfTheWhole) {
    for (const test::Named& named : test::cases) {
        SCOPED_TRACE(named.name);
        const auto& [c, whole] = test::in_one(named);
        expect_same(c, whole, BlockLattice(c.box, GetParam()));
    }
}

INSTANTIATE_TEST_SUITE_P(Blocks, Lattices,
                         ::testing::Values(Coord(1024, 1024, 1024), Coord(64, 64, 128), Coord(8, 512, 256),
                                           Coord(512, 16, 128), Coord(24, 40, 128)),
                         [](const auto& p) {
                             return std::to_string(p.param.x()) + "_" + std::to_string(p.param.y()) + "_" +
                                    std::to_string(p.param.z());
                         });

TEST(BlockMarchingCubesOrder, AnyAxisMayBeCutFirst) {
    const auto& [c, whole] = test::in_one(test::cases[0]);
    std::array<int, 3> order{0, 1, 2};
    do {
        BlockRules rules;
        rules.order = order;
        expect_same(c, whole, BlockLattice(c.box, Coord(24, 64, 128), rules));
    } while (std::next_permutation(order.begin(), order.end()));
}

TEST(BlockMarchingCubesErrors, AreThoseOfTheWhole) {
    const auto& [c, whole] = test::in_one(test::cases[3]);
    Reader reader(c.map);
    const BlockLattice lattice(c.box, Coord(64, 64, 128));
    EXPECT_THROW(BlockMarchingCubes(reader.function(), lattice, {std::nan("")}), InvalidInput);
    EXPECT_THROW(BlockMarchingCubes(reader.function(), lattice, {c.isovalue},
                                    Progress([](double done) { return done < 0.5; })),
                 Cancelled);
    BlockMarchingCubes nothing(reader.function(), BlockLattice(CoordBBox(), Coord(8, 8, 128)), {0});
    EXPECT_EQ(nothing.triangles(), 0u);
    nothing.fill(1 << 20, [](const SurfacePiece&) { ADD_FAILURE() << "a piece of nothing"; });
}

TEST(BlockLattice, CoversTheBoxOnceAtMultiplesOfTheStep) {
    const CoordBBox box(Coord(-13, 5, -200), Coord(90, 77, 300));
    BlockRules rules;
    rules.order = {2, 0, 1};
    rules.below = 8;
    const BlockLattice lattice(box, Coord(40, 16, 128), rules);
    EXPECT_EQ(lattice.count(), Coord(3, 5, 5));  // from -16, 0 and -256
    double volume = 0, largest = 0;
    std::set<Coord> places;
    for (std::size_t n = 0; n < lattice.size(); ++n) {
        const CoordBBox block = lattice.block(n), wanted = lattice.wanted(n), own = lattice.without_border(n);
        EXPECT_EQ(lattice.at(lattice.place(n)), n);
        places.insert(lattice.place(n));
        for (int a = 0; a < 3; ++a) {
            EXPECT_EQ(block.min()[a] % rules.step[a], 0);
            EXPECT_EQ((block.max()[a] + 1) % rules.step[a], 0);
            const bool first = lattice.place(n)[a] == 0, last = lattice.place(n)[a] == lattice.count()[a] - 1;
            EXPECT_EQ(wanted.min()[a], block.min()[a] - (first ? 0 : 8));
            EXPECT_EQ(wanted.max()[a], block.max()[a] + (last ? 0 : 8));
            EXPECT_EQ(own.min()[a], first ? Coord::min()[a] : block.min()[a]);
            EXPECT_EQ(own.max()[a], last ? Coord::max()[a] : block.max()[a]);
        }
        volume += static_cast<double>(block.volume());
        largest = std::max(largest, static_cast<double>(wanted.volume()));
    }
    EXPECT_EQ(places.size(), lattice.size());
    EXPECT_EQ(volume, 112.0 * 80 * 640);
    EXPECT_LE(largest, lattice.largest());
    // Along z first, then x, then y.
    EXPECT_EQ(lattice.place(1), Coord(0, 0, 1));
    EXPECT_EQ(lattice.place(5), Coord(1, 0, 0));
    EXPECT_EQ(lattice.place(15), Coord(0, 1, 0));
}

TEST(BlockLattice, TakesAsFewBlocksAsFit) {
    const CoordBBox box(Coord(0), Coord(999, 999, 999));
    const double all = 1000.0 * 1000 * 1024;
    EXPECT_EQ(BlockLattice::of_volume(box, all).size(), 1u);
    EXPECT_EQ(BlockLattice::of_volume(box, all / 2).count(), Coord(1, 1, 3));  // of 384: two and 8 are more
    EXPECT_EQ(BlockLattice::of_volume(box, all / 12).count(), Coord(1, 2, 8));
    BlockRules x_last;
    x_last.order = {2, 1, 0};
    EXPECT_EQ(BlockLattice::of_volume(box, all / 12, x_last).count().x(), 14);
    for (const double voxels : {4e4, 1e5, 3e6, 1e7, 1e8}) {
        const BlockLattice lattice = BlockLattice::of_volume(box, voxels);
        EXPECT_LE(lattice.largest(), voxels);
        EXPECT_GT(lattice.largest(), voxels / 3);
    }
    EXPECT_THROW(BlockLattice::of_volume(box, 16 * 16 * 136 - 1), NumericalError);
    EXPECT_EQ(BlockLattice::of_volume(CoordBBox(), 1).size(), 0u);
    EXPECT_THROW(BlockLattice(box, Coord(8, 8, 64)), InvalidInput);
    EXPECT_THROW(BlockLattice(CoordBBox(Coord(-(1 << 30)), Coord(1 << 30)), Coord(8, 8, 128)),
                 NumericalError);
}

}  // namespace
}  // namespace vdbgeo
