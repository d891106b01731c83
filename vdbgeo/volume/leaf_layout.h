// How a leaf of a float grid lies in memory, for the few places that work on whole rows.
#pragma once

#include <openvdb/openvdb.h>

namespace vdbgeo::leaf {

using Leaf = openvdb::FloatTree::LeafNodeType;
using LowerNode = openvdb::FloatTree::RootNodeType::ChildNodeType::ChildNodeType;  // 16³ leaves
using UpperNode = openvdb::FloatTree::RootNodeType::ChildNodeType;                 // 32³ lower nodes

constexpr int dim = 8;           // voxels along an edge
constexpr int rows = dim * dim;  // rows of `dim` consecutive z values
constexpr int size = dim * dim * dim;
static_assert(Leaf::DIM == dim && Leaf::SIZE == size, "the kernels are written for 8³ leaves");

/// Row number of (x, y), each 0…7; the row's values are at 8·row … 8·row+7, in z order.
constexpr int row(int x, int y) { return x * dim + y; }
constexpr int offset(int x, int y, int z) { return row(x, y) * dim + z; }

}  // namespace vdbgeo::leaf
