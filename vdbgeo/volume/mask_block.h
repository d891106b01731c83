// 128³ voxels of a mask as rows of bits, for the few places that work on whole rows.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <vector>

namespace vdbgeo::mask {

using Leaf = openvdb::MaskTree::LeafNodeType;
using UpperNode = openvdb::MaskTree::RootNodeType::ChildNodeType;
using LowerNode = UpperNode::ChildNodeType;  // 16³ leaves

constexpr int leaf_dim = 8, leaves = 16, dim = leaves * leaf_dim;
static_assert(Leaf::DIM == leaf_dim && LowerNode::DIM == dim, "the rows are written for these nodes");

/// One byte a leaf: voxel z is bit z % 8 of byte z / 8, which on a little-endian machine is bit z % 64 of
/// word z / 64.
struct Row {
    std::array<std::uint64_t, 2> words{};

    bool empty() const { return (words[0] | words[1]) == 0; }
    bool meets(const Row& other) const {
        return ((words[0] & other.words[0]) | (words[1] & other.words[1])) != 0;
    }
    Row& operator|=(const Row& other) {
        words[0] |= other.words[0];
        words[1] |= other.words[1];
        return *this;
    }
};

inline openvdb::Coord times(const openvdb::Coord& c, int n) { return {c.x() * n, c.y() * n, c.z() * n}; }

/// Bits begin … last of a row.
Row row_between(int begin, int last);

/// The voxels of one lower node, or of a tile in its place. 256 KB.
class Block {
 public:
    Row& row(int x, int y) { return rows_[static_cast<std::size_t>(x * dim + y)]; }
    const Row& row(int x, int y) const { return rows_[static_cast<std::size_t>(x * dim + y)]; }

    void fill(bool on);
    void load(const LowerNode& node);
    /// Makes the node's voxels those of the block: leaves without a voxel go, those with all become tiles.
    void store(LowerNode& node) const;

 private:
    std::vector<Row> rows_ = std::vector<Row>(static_cast<std::size_t>(dim * dim));
};

/// What stands where a lower node can: the node, or an active tile of its size (no node).
struct Place {
    openvdb::Coord origin;
    const LowerNode* node = nullptr;
};

/// All places with something active, in the tree's order. A root tile counts as all the places in it.
std::vector<Place> places_of(const openvdb::MaskTree& mask);

/// Puts lower nodes, which are taken over, into an empty tree; those that are a full tile become one, and
/// those without anything go.
void fill_tree(openvdb::MaskTree& mask, std::vector<std::unique_ptr<LowerNode>>& nodes);

}  // namespace vdbgeo::mask
