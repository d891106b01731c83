#include <fmt/format.h>
#include <openvdb/io/io.h>

#include <algorithm>
#include <fstream>
#include <streambuf>

#include "converters/vdb_file.h"
#include "converters/vdb_skeleton.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;
using openvdb::FloatGrid;
using Leaf = openvdb::FloatTree::LeafNodeType;

/// A stream over bytes in memory that knows what OpenVDB wants to know of a file.
class ByteStream : public std::istream {
 public:
    ByteStream(const VdbSkeleton& skeleton, const VdbEntry& entry, std::string_view bytes)
        : std::istream(nullptr), buffer_(bytes) {
        rdbuf(&buffer_);
        namespace io = openvdb::io;
        io::setVersion(*this, {skeleton.release_major, skeleton.release_minor}, skeleton.version);
        io::setDataCompression(*this, entry.compression);
    }

    /// Bytes read so far.
    std::uint64_t position() const { return buffer_.position(); }

 private:
    struct Buffer : std::streambuf {
        std::uint64_t position() const { return static_cast<std::uint64_t>(gptr() - eback()); }
        explicit Buffer(std::string_view bytes) {
            char* begin = const_cast<char*>(bytes.data());  // never written to: there is no put area
            setg(begin, begin, begin + bytes.size());
        }
    } buffer_;
};

/// What the writer noted of a grid's active voxels; not every writer does.
struct NotedVoxels {
    explicit NotedVoxels(const openvdb::MetaMap& metadata)
        : low(metadata.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MIN)),
          high(metadata.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MAX)),
          count(metadata.getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT)) {}

    bool none() const { return count && count->value() == 0; }

    openvdb::Vec3IMetadata::ConstPtr low, high;
    openvdb::Int64Metadata::ConstPtr count;
};

/// The bounding box that the writer noted has to be a box of plausible size.
void check_noted_box(const std::string& file, const VdbGridInfo& grid) {
    const NotedVoxels noted(grid.metadata);
    if (!noted.low || !noted.high || noted.none()) return;
    constexpr std::int64_t furthest = std::int64_t(1) << 30;
    for (int a = 0; a < 3; ++a) {
        const std::int64_t from = noted.low->value()[a], to = noted.high->value()[a];
        if (from > to)
            throw InvalidInput(
                fmt::format("{}: grid '{}': its bounding box is empty or inverted along axis {}: {} to {}",
                            file, grid.name, "xyz"[a], from, to));
        if (from < -furthest || to > furthest || to - from > furthest)
            throw InvalidInput(
                fmt::format("{}: grid '{}': its bounding box is out of range along axis {}: {} to {}", file,
                            grid.name, "xyz"[a], from, to));
    }
}

void check_loaded(const std::string& file, const FloatGrid& grid) {
    const NotedVoxels noted(grid);
    const std::uint64_t count = grid.activeVoxelCount();
    if (count == 0 && !noted.none())
        throw InvalidInput(fmt::format("{}: grid '{}' holds no voxel{}", file, grid.getName(),
                                       noted.low ? ", though its metadata tells of a bounding box" : ""));
    if (noted.count && static_cast<std::uint64_t>(noted.count->value()) != count)
        throw InvalidInput(fmt::format("{}: grid '{}' holds {} active voxels, not the {} of its metadata",
                                       file, grid.getName(), count, noted.count->value()));
    if (count == 0 || !noted.low || !noted.high) return;
    const auto box = grid.evalActiveVoxelBoundingBox();
    if (noted.low->value() != box.min().asVec3i() || noted.high->value() != box.max().asVec3i())
        throw InvalidInput(
            fmt::format("{}: grid '{}': its voxels do not fill the bounding box that its metadata tells of",
                        file, grid.getName()));
}

const VdbEntry& choose(const std::string& file, const std::vector<VdbEntry>& grids,
                       const std::optional<std::string>& name) {
    const std::string floats = FloatGrid::gridType();
    const VdbEntry* chosen = nullptr;
    const VdbEntry* other = nullptr;  // of that name, but of another type
    for (const VdbEntry& g : grids) {
        if (name && g.info.name != *name) continue;
        if (g.info.type != floats && g.info.type != floats + "_HalfFloat")
            other = &g;
        else if (!chosen || (g.info.name == "density" && chosen->info.name != "density"))
            chosen = &g;
    }
    if (chosen) return *chosen;
    if (name && other)
        throw InvalidInput(fmt::format("{}: grid '{}' holds {}, not floats", file, *name, other->info.type));
    std::string names;
    for (const VdbEntry& g : grids)
        names += fmt::format("{}'{}' ({})", names.empty() ? "" : ", ", g.info.name, g.info.type);
    throw InvalidInput(name ? fmt::format("{}: no grid '{}' among {}", file, *name, names)
                            : fmt::format("{}: no grid of floats among {}", file, names));
}

/// The grid whose tree `entry` has: itself, or the one that it is an instance of.
const VdbEntry& owner_of(VdbCursor& cursor, const std::vector<VdbEntry>& grids, const VdbEntry& entry) {
    if (entry.parent.empty()) return entry;
    for (const VdbEntry& g : grids)
        if (g.unique_name == entry.parent && g.parent.empty() && g.info.type == entry.info.type) return g;
    cursor.fail(
        fmt::format("grid '{}' shares the tree of '{}', which is not there", entry.info.name, entry.parent));
}

/// Makes the tree out of bytes that check_vdb_tree has gone through; the voxels on all threads.
void load_tree(VdbCursor& cursor, const VdbSkeleton& skeleton, const VdbEntry& entry, FloatGrid& grid) {
    const VdbTreeLayout layout = check_vdb_tree(cursor, entry);
    ByteStream in(skeleton, entry, cursor.from(layout.tree_at));
    grid.tree().readTopology(in, entry.half);
    std::vector<Leaf*> leaves;
    leaves.reserve(layout.leaves);
    grid.tree().getNodes(leaves);  // depth first, as they lie in the file
    if (!in || leaves.size() != layout.leaves) cursor.fail("the nodes cannot be read");
    const float background = grid.background();
    parallel_for(layout.chunk_at.size(), 1, [&](std::size_t c) {
        ByteStream buffers(skeleton, entry, cursor.from(layout.chunk_at[c]));
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
    const VdbEntry& entry = choose(file.name(), skeleton.grids, name);
    cursor.enter("'" + entry.info.name + "'");
    const VdbEntry& owner = owner_of(cursor, skeleton.grids, entry);
    try {
        const auto grid = FloatGrid::create();
        static_cast<openvdb::MetaMap&>(*grid) = entry.info.metadata;
        if (&owner != &entry) check_vdb_tree(cursor, entry);
        load_tree(cursor, skeleton, owner, *grid);
        ByteStream transform(skeleton, entry, cursor.from(entry.transform_at));
        grid->readTransform(transform);
        check_loaded(file.name(), *grid);
        return grid;
    } catch (const openvdb::Exception& e) {
        cursor.fail(e.what());
    }
}

}  // namespace vdbgeo
