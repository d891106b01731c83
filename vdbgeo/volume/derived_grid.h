// What every grid that is made from a map has in common: where it lies, where it came from, what it is
// called.
#pragma once

#include <string>

#include "vdbgeo/volume/density_map.h"

namespace vdbgeo {

/// Sets or replaces one entry of the metadata.
template <class T>
void set_metadata(openvdb::MetaMap& metadata, const std::string& name, const T& value) {
    metadata.removeMeta(name);
    metadata.insertMeta(name, openvdb::TypedMetadata<T>(value));
}

/// Gives `grid` the transform and the box of `frame`, the name, and the record of `source`, with `line` as
/// the last entry of its history: of `mrc_*` what tells of the file, its labels and its place. The kind of
/// the file's values and the map's statistics are left behind, since they are not those of the new values.
void derive_from(const openvdb::GridBase& source, const Frame& frame, openvdb::GridBase& grid,
                 const std::string& name, const std::string& line);

}  // namespace vdbgeo
