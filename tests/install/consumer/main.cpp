// A sphere from nothing but the installed headers and libraries.
#include <converters/mesh_file.h>
#include <vdbgeo/measure/mesh_measures.h>
#include <vdbgeo/surface/marching_cubes.h>
#include <vdbgeo/view/colormap.h>
#include <vdbgeo/volume/grid_builder.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
    openvdb::initialize();
    constexpr int n = 40;
    std::vector<float> values;
    for (int z = 0; z < n; ++z)
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x)
                values.push_back(15 - std::hypot(std::hypot(x - 19.5f, y - 19.5f), z - 19.5f));
    vdbgeo::GridBuilder builder({n, n, n}, {0, 1, 2});
    builder.add_sections(values.data(), n);
    const vdbgeo::TriMesh mesh = vdbgeo::marching_cubes(builder.finish({}), {0.0});
    const vdbgeo::MeshMeasures m = vdbgeo::measure_mesh(mesh);
    vdbgeo::write_mesh(mesh, argc > 1 ? argv[1] : "sphere.ply");
    std::printf("area %g, genus %d, %zu colour maps\n", m.area_A2, static_cast<int>(m.genus.value_or(-1)),
                vdbgeo::Colormap::names().size());
    return m.closed && std::abs(m.area_A2 - 4 * M_PI * 225) < 20 ? 0 : 1;
}
