// Delaunay tetrahedra from a map: ours on the sparse grid against CGAL's own image domain on the dense one,
// one thread and several, with the same bounds.
//   bench_delaunay_tets [PHANTOM|MAP.mrc] [SIZE] [ISOVALUE] [REPEAT]
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <cstdlib>
#include <memory>

#include "tests/bench/bench_input.h"
#include "tests/bench/cgal_image_tets.h"
#include "tests/bench/harness.h"
#include "vdbgeo/tet/delaunay_tetrahedra.h"

using namespace vdbgeo;
using namespace vdbgeo::bench;

namespace {

Contender ours(const DensityMap& map, double isovalue, bool parallel, int threads, const char* name) {
    return {name, [&map, isovalue, parallel, threads] {
                const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                                static_cast<std::size_t>(threads));
                DelaunayTetrahedraOptions options;
                options.parallel = parallel;
                const auto mesh = std::make_shared<TetMesh>(delaunay_tetrahedra(map, isovalue, options));
                return Output{mesh->tets.size(), mesh->points.size(), mesh};
            }};
}

Contender theirs(const std::vector<float>& dense, const Frame& frame, double isovalue, bool parallel,
                 int threads, const char* name) {
    return {name, [&dense, frame, isovalue, parallel, threads] {
                const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                                static_cast<std::size_t>(threads));
                const DelaunayTetrahedraOptions o;
                const ImageTets mesh =
                    cgal_image_tets(dense, frame.size, frame.voxel_size().minCoeff(),
                                    static_cast<float>(isovalue), o.facet_angle_deg, o.facet_size,
                                    o.facet_distance, o.cell_radius_edge, o.cell_size, parallel);
                return Output{mesh.tets, mesh.vertices, mesh.keep};
            }};
}

}  // namespace

int main(int argc, char** argv) try {
    openvdb::initialize();
    const std::string name = argc > 1 ? argv[1] : "sphere";
    const int size = argc > 2 ? std::atoi(argv[2]) : 64;
    const Source source =
        name.find('.') != std::string::npos ? mrc_source(name) : phantom_source(name, size, std::nullopt);
    const double isovalue = argc > 3 ? std::atof(argv[3]) : source.isovalue.value_or(0);
    const Inputs inputs = make_inputs(source, true, true, std::nullopt);

    std::vector<Contender> contenders;
    contenders.push_back(ours(*inputs.all, isovalue, false, 1, "vdbgeo"));
    contenders.push_back(theirs(inputs.dense, source.frame, isovalue, false, 1, "cgal-image"));
    contenders.push_back(ours(*inputs.all, isovalue, true, 1, "vdbgeo-parallel-1"));
    contenders.push_back(ours(*inputs.all, isovalue, true, 2, "vdbgeo-parallel-2"));
    contenders.push_back(theirs(inputs.dense, source.frame, isovalue, true, 2, "cgal-image-parallel-2"));
    race(contenders, argc > 4 ? std::atoi(argv[4]) : 3);
    for (const Contender& c : contenders) {
        Report report{"delaunay-tetrahedra", source.name, isovalue, c.program.back() == '2' ? 2 : 1, false};
        report.print(c);
    }
} catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 1;
}
