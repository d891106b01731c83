#include "vdbgeo/volume/derived_grid.h"

namespace vdbgeo {

void derive_from(const openvdb::GridBase& source, const Frame& frame, openvdb::GridBase& grid,
                 const std::string& name, const std::string& line) {
    for (const char* key : {"mrc_file", "mrc_labels", "mrc_axes", "mrc_origin_rule", "mrc_voxel_size",
                            "mrc_sampling", "mrc_size", "mrc_nstart", "mrc_ispg", "vdbgeo_history"})
        if (const auto value = source[key]) {
            grid.removeMeta(key);
            grid.insertMeta(key, *value);
        }
    grid.setName(name);
    grid.setTransform(transform_of(frame));
    if (frame.bounded())
        set_metadata(grid, "vdbgeo_size", openvdb::Vec3i(frame.size.x(), frame.size.y(), frame.size.z()));
    add_history(grid, line);
}

}  // namespace vdbgeo
