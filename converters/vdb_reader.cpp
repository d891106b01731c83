#include <fmt/format.h>
#include <openvdb/io/io.h>

#include <algorithm>
#include <fstream>

#include "converters/vdb_byte_stream.h"
#include "converters/vdb_checks.h"
#include "converters/vdb_file.h"
#include "converters/vdb_skeleton.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;
using openvdb::FloatGrid;
using Leaf = openvdb::FloatTree::LeafNodeType;

/// Makes the tree out of bytes that check_vdb_tree has gone through; the voxels on all threads.
void load_tree(VdbCursor& cursor, const VdbSkeleton& skeleton, const VdbEntry& entry, FloatGrid& grid) {
    const VdbTreeLayout layout = check_vdb_tree(cursor, entry);
    VdbByteStream in(skeleton, entry, cursor.from(layout.tree_at));
    grid.tree().readTopology(in, entry.half);
    std::vector<Leaf*> leaves;
    leaves.reserve(layout.leaves);
    grid.tree().getNodes(leaves);  // depth first, as they lie in the file
    if (!in || leaves.size() != layout.leaves) cursor.fail("the nodes cannot be read");
    const float background = grid.background();
    parallel_for(layout.chunk_at.size(), 1, [&](std::size_t c) {
        VdbByteStream buffers(skeleton, entry, cursor.from(layout.chunk_at[c]));
        openvdb::io::setGridBackgroundValuePtr(buffers, &background);
        const std::size_t begin = c * VdbTreeLayout::chunk,
                          end = std::min<std::size_t>(begin + VdbTreeLayout::chunk, leaves.size());
        for (std::size_t i = begin; i < end; ++i) leaves[i]->readBuffers(buffers, entry.half);
        const std::uint64_t last = c + 1 < layout.chunk_at.size() ? layout.chunk_at[c + 1] : cursor.at();
        const std::uint64_t expected = last - layout.chunk_at[c];
        if (!buffers || buffers.position() != expected) cursor.fail("the voxels cannot be read");
    });
}

}  // namespace

bool is_vdb_file(const fs::path& path) {
    std::error_code ignored;
    if (!fs::is_regular_file(path, ignored)) return false;
    std::ifstream in(path, std::ios::binary);
    std::int64_t signature = 0;
    return in.read(reinterpret_cast<char*>(&signature), 4) &&
           (signature & 0xFFFFFFFF) == openvdb::OPENVDB_MAGIC;
}

std::vector<VdbGridInfo> list_vdb(const fs::path& path) {
    openvdb::initialize();  // registers the types of metadata and transforms; done once
    const MappedFile file(path);
    VdbCursor cursor(file);
    std::vector<VdbGridInfo> grids;
    for (VdbEntry& entry : walk_vdb(cursor).grids) {
        check_noted_box(file.name(), entry.info);
        grids.push_back(std::move(entry.info));
    }
    return grids;
}

FloatGrid::Ptr read_vdb(const fs::path& path, const std::optional<std::string>& name) {
    openvdb::initialize();
    const MappedFile file(path);
    VdbCursor cursor(file);
    const VdbSkeleton skeleton = walk_vdb(cursor);
    for (const VdbEntry& entry : skeleton.grids) check_noted_box(file.name(), entry.info);
    const VdbEntry& entry = choose_vdb_grid(file.name(), skeleton.grids, name);
    cursor.enter("'" + entry.info.name + "'");
    const VdbEntry& owner = owner_of_tree(cursor, skeleton.grids, entry);
    try {
        const auto grid = FloatGrid::create();
        static_cast<openvdb::MetaMap&>(*grid) = entry.info.metadata;
        if (&owner != &entry) check_vdb_tree(cursor, entry);
        load_tree(cursor, skeleton, owner, *grid);
        VdbByteStream transform(skeleton, entry, cursor.from(entry.transform_at));
        grid->readTransform(transform);
        check_voxels(file.name(), entry.info, grid->activeVoxelCount(), grid->evalActiveVoxelBoundingBox());
        return grid;
    } catch (const openvdb::Exception& e) {
        cursor.fail(e.what());
    }
}

}  // namespace vdbgeo
