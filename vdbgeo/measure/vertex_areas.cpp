#include "vdbgeo/measure/vertex_areas.h"

#include "vdbgeo/core/parallel.h"

namespace vdbgeo {

Array<double> vertex_areas(const TriMesh& mesh) {
    check(mesh, "vertex areas");
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (caps && caps->components != 1) caps = nullptr;
    Array<double> thirds(mesh.triangles.size());
    parallel_for(thirds.size(), 1 << 12, [&](std::size_t f) {
        const Triangle& t = mesh.triangles[f];
        const Vec3d a = mesh.points[t[0]].cast<double>();
        const Vec3d u = mesh.points[t[1]].cast<double>() - a, v = mesh.points[t[2]].cast<double>() - a;
        thirds[f] = caps && caps->values[f] > 0.5f ? 0 : u.cross(v).norm() / 6;
    });
    Array<double> areas;
    areas.assign(mesh.points.size(), 0.0);
    for (std::size_t f = 0; f < thirds.size(); ++f)
        for (const VertexId v : mesh.triangles[f]) areas[v] += thirds[f];
    return areas;
}

}  // namespace vdbgeo
