#include "vdbgeo/volume/grid_part.h"

#include <vector>

#include "vdbgeo/volume/leaf_layout.h"

namespace vdbgeo {
namespace {

using openvdb::CoordBBox;

template <class Node>
void copy_tiles_of(const Node& node, const CoordBBox& leaves, openvdb::FloatTree& to) {
    for (auto tile = node.cbeginValueAll(); tile; ++tile) {
        if (!tile.isValueOn() && *tile == to.background()) continue;
        CoordBBox inside = CoordBBox::createCube(tile.getCoord(), Node::ChildNodeType::DIM);
        inside.intersect(leaves);
        if (!inside.empty()) to.sparseFill(inside, *tile, tile.isValueOn());
    }
}

template <class Node>
void copy_tiles_of_nodes(const openvdb::FloatTree& from, const CoordBBox& leaves, openvdb::FloatTree& to) {
    std::vector<const Node*> nodes;
    from.getNodes(nodes);
    for (const Node* node : nodes)
        if (node->getNodeBoundingBox().hasOverlap(leaves)) copy_tiles_of(*node, leaves, to);
}

}  // namespace

CoordBBox whole_leaves(const CoordBBox& box) {
    constexpr int inside = leaf::dim - 1;
    const auto up = [](int last) { return last | inside; };
    return {box.min() & ~inside, {up(box.max().x()), up(box.max().y()), up(box.max().z())}};
}

void copy_tiles(const openvdb::FloatTree& from, const CoordBBox& box, openvdb::FloatTree& to) {
    const CoordBBox leaves = whole_leaves(box);
    copy_tiles_of(from.root(), leaves, to);
    copy_tiles_of_nodes<leaf::UpperNode>(from, leaves, to);
    copy_tiles_of_nodes<leaf::LowerNode>(from, leaves, to);
}

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
    copy_tiles(source->tree(), box, part->tree());
    return part;
}

}  // namespace vdbgeo
