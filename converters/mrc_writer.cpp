#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "converters/mrc.h"
#include "converters/mrc_header.h"
#include "converters/mrc_sink.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {

void MrcWriteOptions::check() const {
    if (mode && !readable_mode(*mode))
        throw InvalidInput(fmt::format("mode {} cannot be written, expected 0, 1, 2, 6, 12 or 101", *mode));
    if (scaling != Scaling::given) return;
    if (!std::isfinite(given.factor) || given.factor == 0 || !std::isfinite(given.offset))
        throw InvalidInput(fmt::format("values cannot be scaled by {} from {}", given.factor, given.offset));
    if (mode == 2) throw InvalidInput("mode 2 holds every value as it is: nothing is scaled");
}

MrcWriteReport write_mrc(const DensityMap& map, const std::filesystem::path& path,
                         const MrcWriteOptions& options, const Progress& progress) {
    if (!map.grid) throw InvalidInput(path.string() + ": there is no grid to write");
    const auto active = map.frame.bounded() ? openvdb::CoordBBox() : map.grid->evalActiveVoxelBoundingBox();
    return write_mrc_from(
        *map.grid, map.frame, active, path, options,
        [&](const MrcBox& box, const std::array<int, 3>& order) {
            return DenseSections(*map.grid, box.first, box.frame.size, order);
        },
        progress);
}

}  // namespace vdbgeo
