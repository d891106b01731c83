#include "vdbgeo/volume/grid_part.h"

#include <vector>

#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using openvdb::CoordBBox;

/// The tiles of a node (none of them active) that touch the box and differ from the background.
template <class Node>
void copy_tiles(const Node& node, const CoordBBox& box, openvdb::FloatTree& to) {
    for (auto tile = node.cbeginValueAll(); tile; ++tile)
        if (*tile != to.background() &&
            CoordBBox::createCube(tile.getCoord(), Node::ChildNodeType::DIM).hasOverlap(box))
            to.addTile(Node::LEVEL, tile.getCoord(), *tile, false);
}

template <class Node>
void copy_tiles(const openvdb::FloatTree& from, const CoordBBox& box, openvdb::FloatTree& to) {
    std::vector<const Node*> nodes;
    from.getNodes(nodes);
    for (const Node* node : nodes)
        if (node->getNodeBoundingBox().hasOverlap(box)) copy_tiles(*node, box, to);
}

}  // namespace

openvdb::FloatGrid::Ptr part_of(const openvdb::FloatGrid& grid, const CoordBBox& box) {
    openvdb::FloatGrid::ConstPtr source = grid.copy();
    if (grid.tree().hasActiveTiles()) {
        const auto leaves = grid.deepCopy();
        leaves->tree().voxelizeActiveTiles();
        source = leaves;
    }
    openvdb::FloatGrid::Ptr part = grid.copyWithNewTree();
    // Shared: a copy of a transform rounds its scale.
    part->setTransform(std::const_pointer_cast<openvdb::math::Transform>(grid.constTransformPtr()));
    for (auto it = source->tree().cbeginLeaf(); it; ++it)
        if (it->getNodeBoundingBox().hasOverlap(box)) part->tree().addLeaf(new leaf::Leaf(*it));
    copy_tiles(source->tree().root(), box, part->tree());
    copy_tiles<leaf::UpperNode>(source->tree(), box, part->tree());
    copy_tiles<leaf::LowerNode>(source->tree(), box, part->tree());
    return part;
}

}  // namespace vdbgeo
