#include "converters/vdb_skeleton.h"

#include <fmt/format.h>

#include <sstream>

#include "converters/vdb_checksum.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

constexpr std::uint32_t oldest_version = 222;  // node masks: everything since OpenVDB 3
constexpr std::uint32_t newest_version = openvdb::OPENVDB_FILE_VERSION;
constexpr const char* half_suffix = "_HalfFloat";

/// One entry's value out of exactly the bytes that it claims.
openvdb::Metadata::Ptr value_of(VdbCursor& cursor, const std::string& name, const std::string& type) {
    const std::uint64_t begin = cursor.at();
    const auto length = cursor.number<std::uint32_t>("length of a metadata entry");
    const char* value = cursor.take(length, "metadata entry");
    // Notes for delayed loading: not used here, and OpenVDB takes what they say without looking.
    if (type == "__delayedload") return nullptr;
    auto made = openvdb::Metadata::isRegisteredType(type)
                    ? openvdb::Metadata::createMetadata(type)
                    : openvdb::Metadata::Ptr(std::make_shared<openvdb::UnknownMetadata>(type));
    const std::uint32_t fixed = made->size();  // strings: 0 as yet
    if (fixed != 0 && fixed != length)
        cursor.fail(fmt::format("metadata '{}' of type {} has {} bytes, not {}", name, type, length, fixed));
    if (type == "bool" && static_cast<unsigned char>(*value) > 1)
        cursor.fail(fmt::format("metadata '{}' is neither true nor false", name));
    std::istringstream in(std::string(cursor.from(begin).substr(0, 4 + std::size_t(length))));
    made->read(in);
    return made;
}

/// `checksum_at`: where the value of the checksum begins, if there is one.
openvdb::MetaMap metadata(VdbCursor& cursor, std::uint64_t* checksum_at = nullptr) {
    const auto count = cursor.number<std::uint32_t>("number of metadata entries");
    if (count > cursor.left() / 12) cursor.fail(fmt::format("{} metadata entries", count));
    openvdb::MetaMap map;
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::string name = cursor.string("name of a metadata entry");
        const std::string type = cursor.string("type of a metadata entry");
        if (checksum_at && name == vdb_checksum_key) *checksum_at = cursor.at() + 4;  // behind its length
        try {
            if (const auto value = value_of(cursor, name, type)) map.insertMeta(name, *value);
        } catch (const openvdb::Exception& e) {
            cursor.fail(fmt::format("metadata '{}' cannot be read: {}", name, e.what()));
        }
    }
    return map;
}

bool ends_with(const std::string& text, const std::string& end) {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// The three positions in a grid's descriptor.
void offsets(VdbCursor& cursor, bool streamed, VdbEntry& entry) {
    const auto grid_at = cursor.number<std::uint64_t>("grid offset");
    entry.block_at = cursor.number<std::uint64_t>("block offset");
    entry.end_at = cursor.number<std::uint64_t>("end offset");
    if (streamed) {
        entry.block_at = entry.end_at = 0;
        return;
    }
    const bool instance = !entry.parent.empty();  // has no voxels of its own
    if (grid_at != cursor.at() || entry.end_at < grid_at || entry.end_at > cursor.size() ||
        (!instance && (entry.block_at < grid_at || entry.block_at > entry.end_at)))
        cursor.fail(
            fmt::format("it claims bytes {} to {} with its voxels from {}: the file is cut off or its "
                        "offsets are wrong",
                        grid_at, entry.end_at, entry.block_at));
}

VdbEntry entry_of(VdbCursor& cursor, int number, bool streamed) {
    VdbEntry entry;
    cursor.enter(fmt::format("number {}", number + 1));
    entry.unique_name = cursor.string("name");
    entry.info.name = entry.unique_name.substr(0, entry.unique_name.find('\x1e'));
    cursor.enter("'" + entry.info.name + "'");
    entry.info.type = cursor.string("type");
    entry.parent = cursor.string("instance parent");
    offsets(cursor, streamed, entry);
    entry.compression = cursor.number<std::uint32_t>("compression");
    constexpr std::uint32_t known =
        openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_BLOSC;
    if ((entry.compression & ~known) != 0)
        cursor.fail(fmt::format("compression {:#x} is not known", entry.compression));
    entry.info.metadata = metadata(cursor);
    entry.half = ends_with(entry.info.type, half_suffix);
    const auto noted = entry.info.metadata[openvdb::GridBase::META_SAVE_HALF_FLOAT];
    if (noted && noted->asBool() != entry.half)
        cursor.fail("its type and its metadata do not agree on whether it holds half floats");
    entry.transform_at = cursor.at();
    if (!streamed && cursor.at() > entry.end_at) cursor.fail("the metadata runs beyond the grid's end");
    return entry;
}

}  // namespace

void VdbCursor::fail(const std::string& what) const {
    const std::string where = grid_.empty() ? "" : fmt::format("grid {}: ", grid_);
    throw InvalidInput(
        fmt::format("{}: damaged VDB file: {}{} (byte {} of {})", name_, where, what, at_, size()));
}

void VdbCursor::seek(std::uint64_t position) {
    if (position > size()) fail(fmt::format("byte {} lies beyond the end", position));
    at_ = position;
}

const char* VdbCursor::take(std::uint64_t bytes, const char* what) {
    if (bytes > left()) fail(fmt::format("the file ends inside: {} ({} bytes needed)", what, bytes));
    if (tidy_ && at_ - released_ >= (16u << 20)) release();
    const char* begin = bytes_.data() + at_;
    at_ += bytes;
    return begin;
}

void VdbCursor::release() {
    file_.release();  // all of it: what is looked at again comes back on its own
    released_ = at_;
}

std::string VdbCursor::string(const char* what) {
    const auto length = number<std::uint32_t>(what);
    return std::string(take(length, what), length);
}

VdbSkeleton walk_vdb(VdbCursor& cursor) {
    VdbSkeleton skeleton;
    if (cursor.left() < 8 || cursor.number<std::int64_t>("signature") != openvdb::OPENVDB_MAGIC)
        throw InvalidInput(cursor.name() + ": not a VDB file: it does not begin with the signature ' BDV'");
    skeleton.version = cursor.number<std::uint32_t>("file version");
    if (skeleton.version < oldest_version || skeleton.version > newest_version)
        cursor.fail(fmt::format("file format version {}, {} to {} can be read", skeleton.version,
                                oldest_version, newest_version));
    skeleton.release_major = cursor.number<std::uint32_t>("library version");
    skeleton.release_minor = cursor.number<std::uint32_t>("library version");
    const auto offsets_flag = cursor.number<std::uint8_t>("offsets flag");
    if (offsets_flag > 1)
        cursor.fail(fmt::format("the flag for grid offsets is {}, not 0 or 1", offsets_flag));
    skeleton.streamed = offsets_flag == 0;
    const std::string identifier(cursor.take(36, "identifier"), 36);
    std::uint64_t checksum_at = 0;
    const auto checksum =
        metadata(cursor, &checksum_at).getMetadata<openvdb::StringMetadata>(vdb_checksum_key);
    const auto count = cursor.number<std::int32_t>("number of grids");
    if (count < 1 || count > 100000) cursor.fail(fmt::format("{} grids", count));
    for (int g = 0; g < count; ++g) {
        skeleton.grids.push_back(entry_of(cursor, g, skeleton.streamed));
        if (skeleton.streamed)
            check_vdb_tree(cursor, skeleton.grids.back());
        else
            cursor.seek(skeleton.grids.back().end_at);
    }
    cursor.enter("");
    if (cursor.left() != 0) cursor.fail(fmt::format("{} bytes behind the last grid", cursor.left()));
    if (checksum) verify_vdb(cursor.file(), identifier, checksum->value(), checksum_at);
    return skeleton;
}

}  // namespace vdbgeo
