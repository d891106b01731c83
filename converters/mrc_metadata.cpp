#include "converters/mrc_metadata.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "converters/mrc_header.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

namespace {

template <class T>
void put(openvdb::MetaMap& meta, const char* name, const T& value) {
    meta.removeMeta(name);  // insertMeta does not change an entry's type
    meta.insertMeta(name, openvdb::TypedMetadata<T>(value));
}

template <class T>
std::optional<T> get(const openvdb::MetaMap& meta, const char* name) {
    const auto entry = meta.getMetadata<openvdb::TypedMetadata<T>>(name);
    if (!entry) return std::nullopt;
    return entry->value();
}

std::optional<Vec3i> get_vec3i(const openvdb::MetaMap& meta, const char* name) {
    if (const auto v = get<openvdb::Vec3i>(meta, name)) return Vec3i(v->x(), v->y(), v->z());
    return std::nullopt;
}

openvdb::Vec3i to_vdb(const Vec3i& v) { return {v.x(), v.y(), v.z()}; }

std::array<int, 3> parse_axes(const std::string& text) {
    std::array<int, 3> order{};
    if (text.size() == 5 && text[1] == ',' && text[3] == ',')
        order = {text[0] - '1', text[2] - '1', text[4] - '1'};
    std::array<int, 3> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    if (sorted != std::array<int, 3>{0, 1, 2})
        throw InvalidInput(
            fmt::format("the metadata mrc_axes is \"{}\", expected 1,2,3 in some order", text));
    return order;
}

}  // namespace

void store_mrc_metadata(openvdb::MetaMap& meta, const MrcReader& reader, const std::string& file) {
    const MrcHeader& h = reader.header();
    const auto& order = reader.order();
    const Vec3d voxel = reader.frame().voxel_size();
    const bool scaled = reader.value_type() == "int8 scaled";
    std::string labels;
    for (const std::string& label : h.labels) labels += (labels.empty() ? "" : "\n") + label;
    put(meta, "mrc_file", file);
    put<std::int32_t>(meta, "mrc_mode", scaled ? 2 : h.mode);  // scaled bytes are no longer whole numbers
    put(meta, "mrc_value_type", reader.value_type());
    put(meta, "mrc_axes", fmt::format("{},{},{}", order[0] + 1, order[1] + 1, order[2] + 1));
    put(meta, "mrc_origin_rule", reader.origin_rule());
    put(meta, "mrc_voxel_size", openvdb::Vec3d(voxel.x(), voxel.y(), voxel.z()));
    put(meta, "mrc_sampling", to_vdb(reader.sampling()));
    put(meta, "mrc_size", to_vdb(reader.frame().size));
    put(meta, "mrc_nstart", openvdb::Vec3i(h.nxstart, h.nystart, h.nzstart));
    put(meta, "mrc_ispg", h.ispg);
    put(meta, "mrc_labels", labels);
    put(meta, "mrc_dmin", h.dmin);
    put(meta, "mrc_dmax", h.dmax);
    put(meta, "mrc_dmean", h.dmean);
    put(meta, "mrc_rms", h.rms);
}

MrcRecord recall_mrc_metadata(const openvdb::MetaMap& meta) {
    MrcRecord record;
    record.mode = get<std::int32_t>(meta, "mrc_mode");
    if (record.mode && !readable_mode(*record.mode))
        throw InvalidInput(
            fmt::format("the metadata mrc_mode is {}, expected 0, 1, 2, 6, 12 or 101", *record.mode));
    record.unsigned_bytes = get<std::string>(meta, "mrc_value_type") == "uint8";
    if (const auto axes = get<std::string>(meta, "mrc_axes")) record.order = parse_axes(*axes);
    record.size = get_vec3i(meta, "mrc_size");
    record.sampling = get_vec3i(meta, "mrc_sampling");
    if (const auto v = get<openvdb::Vec3d>(meta, "mrc_voxel_size"))
        record.voxel_size = Vec3d(v->x(), v->y(), v->z());
    record.origin_rule = get<std::string>(meta, "mrc_origin_rule").value_or("");
    if (const auto start = get_vec3i(meta, "mrc_nstart"))
        for (int i = 0; i < 3; ++i) record.nstart[record.order[static_cast<std::size_t>(i)]] = (*start)[i];
    record.ispg = get<std::int32_t>(meta, "mrc_ispg").value_or(0);
    std::istringstream labels(get<std::string>(meta, "mrc_labels").value_or(""));
    for (std::string label; std::getline(labels, label);) record.labels.push_back(label);
    return record;
}

}  // namespace vdbgeo
