#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "converters/vdb_file.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;
using openvdb::Vec3i;

constexpr std::uint32_t oldest_version = 222;  // node masks: everything since OpenVDB 3
constexpr std::uint32_t newest_version = openvdb::OPENVDB_FILE_VERSION;

/// Reads the skeleton of a file, with every length checked against what is left of it.
class Skeleton {
 public:
    explicit Skeleton(const fs::path& path) : name_(path.string()), in_(path, std::ios::binary) {
        std::error_code error;
        if (fs::is_directory(path, error)) throw IoError(name_ + ": is a directory");
        if (!in_) throw IoError(fmt::format("{}: cannot be opened: {}", name_, std::strerror(errno)));
        size_ = static_cast<std::uint64_t>(fs::file_size(path, error));
        if (error) throw IoError(fmt::format("{}: {}", name_, error.message()));
    }

    [[noreturn]] void fail(const std::string& what) const {
        throw InvalidInput(fmt::format("{}: damaged VDB file: {} (byte {} of {})", name_, what, at_, size_));
    }

    /// Walks the header, the file's metadata, and every grid's descriptor; the metadata of the grids comes
    /// back.
    std::vector<VdbGridInfo> walk() {
        if (number<std::uint64_t>("signature") != openvdb::OPENVDB_MAGIC)
            throw InvalidInput(name_ + ": not a VDB file: it does not begin with the signature ' BDV'");
        const auto version = number<std::uint32_t>("file version");
        if (version < oldest_version || version > newest_version)
            fail(fmt::format("file format version {}, {} to {} can be read", version, oldest_version,
                             newest_version));
        number<std::uint32_t>("library version");
        number<std::uint32_t>("library version");
        const auto offsets = number<std::uint8_t>("offsets flag");
        if (offsets > 1) fail(fmt::format("the flag for grid offsets is {}, not 0 or 1", offsets));
        skip(36, "identifier");
        metadata("the file");
        const auto count = number<std::int32_t>("number of grids");
        if (count < 1 || count > 100000) fail(fmt::format("{} grids", count));
        std::vector<VdbGridInfo> grids;
        if (!offsets) return grids;  // written to a pipe: no way to look ahead
        for (int g = 0; g < count; ++g) grids.push_back(grid(g));
        if (at_ != size_) fail(fmt::format("{} bytes behind the last grid", size_ - at_));
        return grids;
    }

 private:
    VdbGridInfo grid(int number_of_grid) {
        VdbGridInfo info;
        info.name = string(fmt::format("name of grid {}", number_of_grid));
        info.name = info.name.substr(0, info.name.find('\x1e'));  // the writer's suffix for equal names
        info.type = string("type of grid '" + info.name + "'");
        const std::string parent = string("instance parent");
        const auto grid_at = number<std::int64_t>("grid offset"),
                   block_at = number<std::int64_t>("block offset"),
                   end_at = number<std::int64_t>("end offset");
        const auto here = static_cast<std::int64_t>(at_), end = static_cast<std::int64_t>(size_);
        if (grid_at != here || block_at < grid_at || end_at < block_at || end_at > end)
            fail(fmt::format(
                "grid '{}' claims bytes {} to {} with its voxels from {}: the file is cut off or its offsets "
                "are wrong",
                info.name, grid_at, end_at, block_at));
        number<std::uint32_t>("compression of grid '" + info.name + "'");
        info.metadata = metadata("grid '" + info.name + "'");
        if (at_ > static_cast<std::uint64_t>(end_at)) fail("the metadata runs beyond the end of its grid");
        seek(static_cast<std::uint64_t>(end_at));
        return info;
    }

    openvdb::MetaMap metadata(const std::string& whose) {
        const std::uint64_t begin = at_;
        const auto count = number<std::uint32_t>("number of metadata entries");
        if (count > (size_ - at_) / 12) fail(fmt::format("{} metadata entries of {}", count, whose));
        for (std::uint32_t i = 0; i < count; ++i) {
            string("name of a metadata entry");
            string("type of a metadata entry");
            skip(number<std::uint32_t>("length of a metadata entry"), "metadata entry");
        }
        const std::uint64_t end = at_;
        seek(begin);
        openvdb::MetaMap map;
        try {
            map.readMeta(in_);
        } catch (const openvdb::Exception& e) {
            fail(fmt::format("the metadata of {} cannot be read: {}", whose, e.what()));
        }
        seek(end);
        return map;
    }

    template <class T>
    T number(const std::string& what) {
        T value{};
        need(sizeof value, what);
        in_.read(reinterpret_cast<char*>(&value), sizeof value);
        if (!in_) fail("cannot be read");
        at_ += sizeof value;
        return value;
    }

    std::string string(const std::string& what) {
        const auto length = number<std::uint32_t>(what);
        need(length, what);
        std::string text(length, '\0');
        in_.read(text.data(), length);
        at_ += length;
        return text;
    }

    void need(std::uint64_t bytes, const std::string& what) const {
        if (bytes > size_ - at_) fail(fmt::format("the file ends inside: {} ({} bytes needed)", what, bytes));
    }

    void skip(std::uint64_t bytes, const std::string& what) {
        need(bytes, what);
        seek(at_ + bytes);
    }

    void seek(std::uint64_t position) {
        in_.clear();
        in_.seekg(static_cast<std::streamoff>(position));
        at_ = position;
    }

    std::string name_;
    std::ifstream in_;
    std::uint64_t size_ = 0, at_ = 0;
};

/// The bounding box that the writer noted has to be a box of plausible size.
void check_noted_box(const std::string& file, const VdbGridInfo& grid) {
    const auto low = grid.metadata.getMetadata<openvdb::Vec3IMetadata>("file_bbox_min");
    const auto high = grid.metadata.getMetadata<openvdb::Vec3IMetadata>("file_bbox_max");
    if (!low || !high) return;
    constexpr std::int64_t furthest = std::int64_t(1) << 30;
    for (int a = 0; a < 3; ++a) {
        const std::int64_t from = low->value()[a], to = high->value()[a];
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

void check_loaded(const std::string& file, const openvdb::FloatGrid& grid) {
    const auto box = grid.evalActiveVoxelBoundingBox();
    const auto low = grid.getMetadata<openvdb::Vec3IMetadata>("file_bbox_min");
    const auto high = grid.getMetadata<openvdb::Vec3IMetadata>("file_bbox_max");
    if (!low || !high || (box.empty() && low->value() == high->value())) return;
    if (box.empty())
        throw InvalidInput(
            fmt::format("{}: grid '{}' holds no voxel, though its metadata tells of a bounding box", file,
                        grid.getName()));
    if (low->value() != box.min().asVec3i() || high->value() != box.max().asVec3i())
        throw InvalidInput(
            fmt::format("{}: grid '{}': its voxels do not fill the bounding box that its metadata tells of",
                        file, grid.getName()));
}

std::string choose(const std::string& file, const std::vector<VdbGridInfo>& grids,
                   const std::optional<std::string>& name) {
    const std::string float_type = openvdb::FloatGrid::gridType();
    const VdbGridInfo* chosen = nullptr;
    for (const VdbGridInfo& g : grids) {
        if (name && g.name != *name) continue;
        const bool floats = g.type.substr(0, float_type.size()) == float_type;
        if (name && !floats)
            throw InvalidInput(fmt::format("{}: grid '{}' holds {}, not floats", file, g.name, g.type));
        if (floats && (!chosen || (g.name == "density" && chosen->name != "density"))) chosen = &g;
    }
    if (chosen) return chosen->name;
    std::string names;
    for (const VdbGridInfo& g : grids)
        names += fmt::format("{}'{}' ({})", names.empty() ? "" : ", ", g.name, g.type);
    throw InvalidInput(name ? fmt::format("{}: no grid '{}' among {}", file, *name, names)
                            : fmt::format("{}: no grid of floats among {}", file, names));
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
    std::vector<VdbGridInfo> grids = Skeleton(path).walk();
    for (const VdbGridInfo& grid : grids) check_noted_box(path.string(), grid);
    return grids;
}

openvdb::FloatGrid::Ptr read_vdb(const fs::path& path, const std::optional<std::string>& name) {
    std::vector<VdbGridInfo> grids = list_vdb(path);
    try {
        openvdb::io::File file(path.string());
        file.setCopyMaxBytes(0);
        file.open(false);     // no delayed loading: a fault shows now, not in the middle of a computation
        if (grids.empty()) {  // written to a pipe: everything is loaded by now
            for (auto it = file.beginName(); it != file.endName(); ++it)
                grids.push_back({*it, file.readGridMetadata(*it)->type(), {}});
        }
        auto grid =
            openvdb::GridBase::grid<openvdb::FloatGrid>(file.readGrid(choose(path.string(), grids, name)));
        if (!grid) throw InvalidInput(path.string() + ": the grid does not hold floats");
        check_loaded(path.string(), *grid);
        return grid;
    } catch (const openvdb::Exception& e) {
        throw InvalidInput(fmt::format("{}: damaged VDB file: {}", path.string(), e.what()));
    }
}

}  // namespace vdbgeo
