// CGAL's own way from a map to tetrahedra, for the benchmark: a gray image as the domain.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "vdbgeo/core/types.h"

namespace vdbgeo::bench {

struct ImageTets {
    std::uint64_t tets = 0, vertices = 0;
    std::shared_ptr<void> keep;
};

/// Labeled_mesh_domain_3::create_gray_image_mesh_domain on a dense map, x fastest; lengths in voxels, made
/// manifold and without optimisers.
ImageTets cgal_image_tets(const std::vector<float>& values, const Vec3i& size, double voxel, float isovalue,
                          double angle_deg, double facet_size, double facet_distance, double radius_edge,
                          double cell_size, bool parallel);

}  // namespace vdbgeo::bench
