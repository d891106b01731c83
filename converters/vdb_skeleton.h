// What stands where in a VDB file. OpenVDB trusts the lengths that it reads: a damaged one makes it write
// beyond its buffers or take all memory. So every one is checked here before OpenVDB sees a byte.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "converters/mapped_file.h"
#include "converters/vdb_file.h"

namespace vdbgeo {

/// Reads on through the bytes of a VDB file; what would lie beyond the end is an error.
class VdbCursor {
 public:
    /// `tidy`: memory is given back behind the cursor, so that a walk through the file takes some 20 MB of
    /// it.
    explicit VdbCursor(const MappedFile& file, bool tidy = false)
        : file_(file), bytes_(file.bytes()), name_(file.name()), tidy_(tidy) {}

    /// Throws InvalidInput that tells `what` is wrong and where.
    [[noreturn]] void fail(const std::string& what) const;
    /// Whose bytes these are, for the messages.
    void enter(const std::string& grid) { grid_ = grid; }

    const MappedFile& file() const { return file_; }
    const std::string& name() const { return name_; }
    std::uint64_t at() const { return at_; }
    std::uint64_t left() const { return bytes_.size() - at_; }
    std::uint64_t size() const { return bytes_.size(); }
    void seek(std::uint64_t position);
    std::string_view from(std::uint64_t position) const { return bytes_.substr(position); }

    /// The next `bytes` bytes.
    const char* take(std::uint64_t bytes, const char* what);
    std::string string(const char* what);
    template <class T>
    T number(const char* what) {
        T value;
        std::memcpy(&value, take(sizeof value, what), sizeof value);
        return value;
    }

 private:
    void release();

    const MappedFile& file_;
    std::string_view bytes_;
    std::string name_, grid_;
    std::uint64_t at_ = 0, released_ = 0;
    bool tidy_;
};

/// One grid of a file: what its descriptor and its metadata say.
struct VdbEntry {
    VdbGridInfo info;
    std::string unique_name;  ///< with the writer's suffix where several grids have one name
    std::string parent;       ///< unique name of the grid whose tree this one shares; else empty
    std::uint32_t compression = 0;
    bool half = false;               ///< voxels are stored as 16-bit floats
    std::uint64_t transform_at = 0;  ///< where its transform begins; the tree follows
    std::uint64_t block_at = 0;      ///< where its leaf buffers begin; 0 in a file written to a pipe
    std::uint64_t end_at = 0;        ///< where it ends; 0 in a file written to a pipe
};

struct VdbSkeleton {
    std::uint32_t version = 0, release_major = 0, release_minor = 0;
    bool streamed = false;  ///< written to a pipe: without offsets, one grid behind the other
    std::vector<VdbEntry> grids;
};

/// Header, metadata, and every grid's descriptor. In a file written to a pipe the trees are walked too: there
/// is no other way to the next grid.
VdbSkeleton walk_vdb(VdbCursor& cursor);

/// Where the tree of a grid lies.
struct VdbTreeLayout {
    static constexpr std::uint64_t chunk = 256;  ///< leaves between two noted positions
    std::uint64_t tree_at = 0;                   ///< behind the transform
    std::uint64_t leaves = 0;
    std::vector<std::uint64_t> chunk_at;  ///< where the buffers of every 256th leaf begin
};

/// What a walk through a tree comes past, in the order of the file.
class VdbTreeVisitor {
 public:
    virtual ~VdbTreeVisitor() = default;
    virtual void background(const char* value) = 0;
    virtual void root_tile(const openvdb::Coord& origin, const char* value, bool active) = 0;
    /// An internal node: level 2 has 32³ children, each a node of level 1; level 1 has 16³ leaves. Masks have
    /// a bit for each child; the values lie from byte `values_at` to `end`.
    virtual void node(int level, const openvdb::Coord& origin, std::string_view children,
                      std::string_view active, std::uint64_t values_at, std::uint64_t end) = 0;
    /// The buffer of the next leaf: its mask of active voxels, and where it lies, beginning with that mask.
    virtual void leaf(std::string_view mask, std::uint64_t at, std::uint64_t end) = 0;
};

/// Walks a grid's transform and tree, node by node, and leaves the cursor behind it: masks, the flags and
/// sizes of compressed blocks, positions and order of nodes. Cost: one pass over the grid's bytes, of which
/// only the heads of the blocks are looked at, and 8 bytes of memory for every 64 leaves.
VdbTreeLayout check_vdb_tree(VdbCursor& cursor, const VdbEntry& entry, VdbTreeVisitor* visitor = nullptr);

}  // namespace vdbgeo
