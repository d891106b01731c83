#include "converters/map_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "converters/vdb_sections.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/volume/grid_part.h"

namespace vdbgeo {
namespace {

namespace fs = std::filesystem;
using openvdb::Coord;
using openvdb::CoordBBox;

constexpr const char *box_begin = "vdbgeo_part_begin", *box_end = "vdbgeo_part_end";

bool is_part(const fs::path& file) {
    const std::string name = file.filename().string();
    return name.rfind("part_", 0) == 0 && file.extension() == ".vdb";
}

/// What a process that was killed left, where files without a name cannot be made: AtomicFile's temporary.
bool is_unfinished(const fs::path& file) { return file.filename().string().rfind(".vdbgeo.", 0) == 0; }

template <class Wanted>
std::vector<fs::path> files_in(const fs::path& folder, const Wanted& wanted) {
    std::vector<fs::path> files;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error))
        if (wanted(entry.path())) files.push_back(entry.path());
    if (error) throw IoError(fmt::format("{}: cannot be listed: {}", folder.string(), error.message()));
    std::sort(files.begin(), files.end());
    return files;
}

CoordBBox box_of_part(const VdbSections& part, const fs::path& file) {
    const auto at = [&](const char* name) {
        const auto entry = part.grid().getMetadata<openvdb::Vec3IMetadata>(name);
        if (!entry)
            throw InvalidInput(
                fmt::format("{}: its metadata lack {}: it is no part of a map", file.string(), name));
        return Coord(entry->value());
    };
    return {at(box_begin), at(box_end)};
}

}  // namespace

void write_map_part(const DensityMap& map, const CoordBBox& own, int number, const fs::path& folder,
                    const VdbWriteOptions& options, const Progress& progress) {
    const openvdb::FloatGrid::Ptr part = map.grid->copyWithNewTree();
    part->setTransform(map.grid->transformPtr());  // a copy of it rounds its scale
    const openvdb::FloatTree& tree = map.grid->constTree();
    for (auto it = tree.cbeginLeaf(); it; ++it)
        if (own.isInside(it->origin())) part->tree().addLeaf(new leaf::Leaf(*it));
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        if (!tile.isValueOn() && *tile == tree.background()) continue;
        CoordBBox inside;
        tile.getBoundingBox(inside);
        inside.intersect(own);
        // Where they do not touch, the intersection still has corners, and they may lie among own leaves.
        if (inside.hasVolume()) part->tree().sparseFill(inside, *tile, tile.isValueOn());
    }
    part->insertMeta(box_begin, openvdb::Vec3IMetadata(own.min().asVec3i()));
    part->insertMeta(box_end, openvdb::Vec3IMetadata(own.max().asVec3i()));
    write_vdb({part}, folder / fmt::format("part_{:04}.vdb", number), options, progress);
}

void remove_map_parts(const fs::path& folder) {
    std::error_code error;
    if (!fs::is_directory(folder, error)) return;
    for (const fs::path& file :
         files_in(folder, [](const fs::path& f) { return is_part(f) || is_unfinished(f); }))
        if (!fs::remove(file, error))
            throw IoError(fmt::format("{}: cannot be removed: {}", file.string(), error.message()));
    if (fs::is_empty(folder, error)) fs::remove(folder, error);
}

bool is_map_parts(const fs::path& path) {
    std::error_code error;
    if (!fs::is_directory(path, error)) return false;
    const auto files = fs::directory_iterator(path, error);
    return !error && std::any_of(begin(files), end(files), [](const auto& f) { return is_part(f.path()); });
}

struct MapParts::State {
    std::vector<VdbSections> parts;
    std::vector<CoordBBox> boxes;
    openvdb::MetaMap meta;
    CoordBBox active_box;
    std::uint64_t active_voxels = 0;

    float background() const { return parts[0].grid().background(); }
    std::size_t part_at(const Coord& corner) const {
        std::size_t i = 0;
        while (i < boxes.size() && !boxes[i].isInside(corner)) ++i;
        return i;
    }
    /// Leaves of all parts, for one thread.
    VdbSections::Leaves leaf_reader() const;
};

VdbSections::Leaves MapParts::State::leaf_reader() const {
    const auto readers = std::make_shared<std::vector<VdbSections::Leaves>>(parts.size());
    return [this, readers](const Coord& corner, float& tile) -> const leaf::Leaf* {
        const std::size_t i = part_at(corner);
        if (i == parts.size()) {
            tile = background();
            return nullptr;
        }
        if (!(*readers)[i]) (*readers)[i] = parts[i].leaf_reader();
        return (*readers)[i](corner, tile);
    };
}

MapParts::MapParts(const fs::path& folder) : state_(std::make_unique<State>()) {
    State& s = *state_;
    for (const fs::path& file : files_in(folder, is_part)) {
        s.parts.emplace_back(file);
        const VdbSections& part = s.parts.back();
        const CoordBBox box = box_of_part(part, file);
        for (const CoordBBox& other : s.boxes)
            if (other.hasOverlap(box))
                throw InvalidInput(fmt::format("{}: its box overlaps another part's", file.string()));
        s.boxes.push_back(box);
        const Frame &first = s.parts[0].frame(), &here = part.frame();
        if (first.size != here.size || first.origin != here.origin || first.axes != here.axes ||
            s.background() != part.grid().background())
            throw InvalidInput(fmt::format("{}: it is no part of the same map as the first", file.string()));
        s.active_voxels += part.active_voxels();
        if (part.active_voxels() > 0) s.active_box.expand(part.active_box());
    }
    if (s.parts.empty())
        throw InvalidInput(folder.string() + ": there are no parts of a map (part_0000.vdb …)");
    s.meta = static_cast<const openvdb::MetaMap&>(s.parts[0].grid());
    for (const char* name : {box_begin, box_end}) s.meta.removeMeta(name);
}

MapParts::~MapParts() = default;
MapParts::MapParts(MapParts&&) noexcept = default;

const Frame& MapParts::frame() const { return state_->parts[0].frame(); }
std::uint64_t MapParts::active_voxels() const { return state_->active_voxels; }
const CoordBBox& MapParts::active_box() const { return state_->active_box; }
std::size_t MapParts::parts() const { return state_->parts.size(); }

std::uint64_t MapParts::memory() const {
    std::uint64_t bytes = 0;
    for (const VdbSections& part : state_->parts) bytes += part.memory();
    return bytes;
}

openvdb::FloatGrid::Ptr MapParts::empty_grid() const {
    openvdb::FloatGrid::Ptr grid = state_->parts[0].empty_grid();
    static_cast<openvdb::MetaMap&>(*grid) = state_->meta;
    return grid;
}

std::vector<CoordBBox> MapParts::pieces() const {
    std::vector<CoordBBox> all;
    for (const VdbSections& part : state_->parts)
        for (const CoordBBox& piece : part.pieces()) all.push_back(piece);
    sort_pieces(all);
    return all;
}

void MapParts::copy_to(const CoordBBox& box, openvdb::FloatTree& to, const Progress& progress) const {
    const double count = static_cast<double>(parts());
    for (std::size_t i = 0; i < parts(); ++i) {
        CoordBBox inside = whole_leaves(box);
        inside.intersect(state_->boxes[i]);
        const double before = static_cast<double>(i) / count;
        if (!inside.empty()) state_->parts[i].copy_to(inside, to, progress.part(before, before + 1 / count));
    }
}

/// The whole as it is written.
LeafSource MapParts::leaves() const {
    const State* const s = state_.get();
    LeafSource map;
    map.frame = frame();
    map.meta = s->meta;
    map.transform = s->parts[0].grid().constTransformPtr();
    map.background = s->background();
    map.active_box = s->active_box;
    map.finder = [s]() -> LeafSource::Finder {
        return [s, leaves = s->leaf_reader()](const Coord& corner) {
            LeafSource::Found found;
            found.leaf = leaves(corner, found.tile);
            const std::size_t part = found.leaf ? s->parts.size() : s->part_at(corner);
            found.on = part < s->parts.size() && s->parts[part].grid().tree().isValueOn(corner);
            return found;
        };
    };
    return map;
}

MrcWriteReport MapParts::write_mrc(const fs::path& path, const MrcWriteOptions& options,
                                   const Progress& progress) const {
    return vdbgeo::write_mrc(leaves(), path, options, progress);
}

void MapParts::write_vdb(const fs::path& path, const VdbWriteOptions& options, std::uint64_t memory,
                         const fs::path& scratch, const Progress& progress) const {
    vdbgeo::write_vdb(leaves(), path, options, memory, scratch, progress);
}

}  // namespace vdbgeo
