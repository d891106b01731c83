// Which 8³ blocks of a sparse grid a level set runs through, and their samples. For the surface extractors;
// nothing outside this folder needs it.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "vdbgeo/core/progress.h"
#include "vdbgeo/volume/density_map.h"
#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {

/// Which samples of a leaf are at or above the isovalue: bit 8·y + z of word x.
struct LeafSigns {
    std::uint64_t word[leaf::dim];
};

/// The signs at the corners of a block's cells: bit 8·y + z of word x is the sample at (x, y, z) in `here`,
/// at (x, y+1, z) in `y`, at (x, y, z+1) in `z` and at (x, y+1, z+1) in `yz`.
struct CornerSigns {
    std::uint64_t here[leaf::dim + 1], y[leaf::dim + 1], z[leaf::dim + 1], yz[leaf::dim + 1];
};

/// The samples of one block and of the first layer of its upper neighbours, 9³ in all: what its cells need.
struct BlockSamples {
    static constexpr int dim = leaf::dim + 1;
    /// Row (x, y) begins at values[x][y]; 9 of the 12 floats are samples in z order.
    alignas(16) float values[dim][dim][12];
};

/// The blocks of a grid whose cells, or whose edges, may cross the isovalue: those where a sample of the
/// block or of its upper neighbours' first layers lies on the other side than another. A block is aligned to
/// the leaves but need not be one: a level set also runs between a leaf and a tile, and between two tiles.
///
/// Finding them reads every leaf once (bandwidth-bound) and looks at every lower internal node's 16³
/// children.
class CrossingBlocks {
 public:
    /// Only blocks that begin `within` a box, whose faces lie at multiples of 8, are found. What the tree
    /// holds further than 8 voxels above it, or below it, tells nothing, so it need not be there.
    ///
    /// Throws InvalidInput where a constant tile of 4096³ voxels in the box of the frame lies across the
    /// isovalue from the background, and where a node lies within 256 voxels of an end of the indices.
    CrossingBlocks(const openvdb::FloatTree& tree, const Frame& frame, float isovalue,
                   const Progress& progress, const openvdb::CoordBBox& within = openvdb::CoordBBox::inf());

    std::size_t size() const { return blocks_.size(); }
    /// Index of the first voxel of block b. The order is fixed by the coordinates alone.
    openvdb::Coord origin(std::size_t b) const { return blocks_[b].origin; }
    /// Block b (bit pattern 0) and its upper neighbours: bit a of `side` steps along axis a. -1 where the
    /// neighbour is not crossed.
    std::int64_t neighbour(std::size_t b, int side) const;
    /// The signs of block b's samples and of its upper neighbours' first layers.
    void load_signs(std::size_t b, CornerSigns& out) const;
    void load(std::size_t b, BlockSamples& out) const;

 private:
    static constexpr int node_dim = 16;  // blocks along an edge of a node
    static constexpr int node_blocks = node_dim * node_dim * node_dim;
    enum State : std::uint8_t { below = 1, above = 2, mixed = 3 };

    struct Node {
        openvdb::Coord origin;
        std::array<int, 8> upper{};  // this node and its upper neighbours, -1 outside all nodes
        std::array<std::uint8_t, 8> upper_state{};  // of those that are outside all nodes
        std::vector<std::uint8_t> state;            // per block
        std::vector<const float*> samples;          // per block, its leaf's values, null for a tile
        std::vector<std::int32_t> signs_at;         // per block that is mixed, its place in `signs`
        std::vector<LeafSigns> signs;               // of the blocks that are mixed
        const leaf::LowerNode* lower = nullptr;     // null where the node is a tile
        std::vector<std::int32_t> block;            // per block, its number or -1
    };
    struct Block {
        openvdb::Coord origin;
        std::int32_t node;
        std::int32_t place;  // in the node
    };
    struct Place {
        int node;   // -1: outside all nodes
        int block;  // in that node
        int side;   // which of the 8 nodes around
    };

    static int place(int i, int j, int k) { return (i * node_dim + j) * node_dim + k; }
    State sign_state(float value) const { return value >= isovalue_ ? above : below; }
    Place step(const Block& block, int side) const;
    bool outside_box(const openvdb::Coord& origin, int dim) const;
    bool out_of_reach(const openvdb::Coord& origin, int dim) const;
    void add_nodes(const openvdb::Coord& origin);
    void collect_nodes();
    void classify(Node& node) const;
    void find_blocks(std::size_t n, std::vector<Block>& out) const;
    const LeafSigns& signs(const Block& block, int side) const;
    float constant_value(const Block& block, int side) const;
    void prefetch(std::size_t b) const;
    void load_rows(const Block& block, int side, BlockSamples& out) const;

    const openvdb::FloatTree& tree_;
    const Frame frame_;
    const float isovalue_;
    const openvdb::CoordBBox within_;
    std::vector<Node> nodes_;
    std::unordered_map<openvdb::Coord, int> node_at_;
    std::vector<Block> blocks_;
};

}  // namespace vdbgeo
