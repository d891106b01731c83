#include "tests/bench/cgal_image_tets.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Image_3.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/make_mesh_3.h>

#include <cstring>

namespace vdbgeo::bench {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Domain = CGAL::Labeled_mesh_domain_3<Kernel>;

CGAL::Image_3 image_of(const std::vector<float>& values, const Vec3i& size, double voxel) {
    _image* image =
        _createImage(static_cast<std::size_t>(size.x()), static_cast<std::size_t>(size.y()),
                     static_cast<std::size_t>(size.z()), 1, voxel, voxel, voxel, 4, WK_FLOAT, SGN_SIGNED);
    std::memcpy(image->data, values.data(), values.size() * sizeof(float));
    return CGAL::Image_3(image);
}

}  // namespace

ImageTets cgal_image_tets(const std::vector<float>& values, const Vec3i& size, double voxel, float isovalue,
                          double angle_deg, double facet_size, double facet_distance, double radius_edge,
                          double cell_size, bool parallel) {
    namespace param = CGAL::parameters;
    const CGAL::Image_3 image = image_of(values, size, voxel);  // the domain keeps a reference to it
    const Domain domain = Domain::create_gray_image_mesh_domain(image, param::iso_value = isovalue,
                                                                param::value_outside = isovalue - 1,
                                                                param::relative_error_bound = 1e-5);
    const auto run = [&](auto tag) {
        using Triangulation = typename CGAL::Mesh_triangulation_3<Domain, CGAL::Default, decltype(tag)>::type;
        using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
        const CGAL::Mesh_criteria_3<Triangulation> criteria(
            param::facet_angle = angle_deg, param::facet_size = voxel * facet_size,
            param::facet_distance = voxel * facet_distance, param::cell_radius_edge_ratio = radius_edge,
            param::cell_size = voxel * cell_size);
        const auto complex = std::make_shared<Complex>(CGAL::make_mesh_3<Complex>(
            domain, criteria, param::manifold(), param::no_perturb(), param::no_exude()));
        return ImageTets{complex->number_of_cells_in_complex(), complex->triangulation().number_of_vertices(),
                         complex};
    };
    return parallel ? run(CGAL::Parallel_tag()) : run(CGAL::Sequential_tag());
}

}  // namespace vdbgeo::bench
