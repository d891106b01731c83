#include "converters/vdb_checks.h"

#include <fmt/format.h>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

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

}  // namespace

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

void check_voxels(const std::string& file, const VdbGridInfo& grid, std::uint64_t count,
                  const openvdb::CoordBBox& box) {
    const NotedVoxels noted(grid.metadata);
    if (count == 0 && !noted.none())
        throw InvalidInput(fmt::format("{}: grid '{}' holds no voxel{}", file, grid.name,
                                       noted.low ? ", though its metadata tells of a bounding box" : ""));
    if (noted.count && static_cast<std::uint64_t>(noted.count->value()) != count)
        throw InvalidInput(fmt::format("{}: grid '{}' holds {} active voxels, not the {} of its metadata",
                                       file, grid.name, count, noted.count->value()));
    if (count == 0 || !noted.low || !noted.high) return;
    if (noted.low->value() != box.min().asVec3i() || noted.high->value() != box.max().asVec3i())
        throw InvalidInput(
            fmt::format("{}: grid '{}': its voxels do not fill the bounding box that its metadata tells of",
                        file, grid.name));
}

const VdbEntry& choose_vdb_grid(const std::string& file, const std::vector<VdbEntry>& grids,
                                const std::optional<std::string>& name) {
    const std::string floats = openvdb::FloatGrid::gridType();
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

const VdbEntry& owner_of_tree(VdbCursor& cursor, const std::vector<VdbEntry>& grids, const VdbEntry& entry) {
    if (entry.parent.empty()) return entry;
    for (const VdbEntry& g : grids)
        if (g.unique_name == entry.parent && g.parent.empty() && g.info.type == entry.info.type) return g;
    cursor.fail(
        fmt::format("grid '{}' shares the tree of '{}', which is not there", entry.info.name, entry.parent));
}

}  // namespace vdbgeo
