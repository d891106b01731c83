#include "vdbgeo/measure/fit_surface.h"

#include <algorithm>

#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/vertex_faces.h"

namespace vdbgeo {

TriMesh FitSurface::without_caps(const TriMesh& mesh) {
    TriMesh out;
    const MeshProperty* caps = mesh.find_face_property(cap_property);
    if (!caps || caps->components != 1) return out;
    if (std::none_of(caps->values.begin(), caps->values.end(), [](float c) { return c > 0.5f; })) return out;
    out.points = mesh.points;
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f)
        if (!(caps->values[f] > 0.5f)) out.triangles.push_back(mesh.triangles[f]);
    return out;
}

FitSurface::FitSurface(const TriMesh& original)
    : mesh_(original), without_caps_(without_caps(original)), neighbours_(mesh()) {
    const TriMesh& m = mesh();
    const VertexFaces faces(m);
    normals_.resize(m.points.size());
    areas_.resize(m.points.size());
    parallel_for(m.points.size(), 1 << 12, [&](std::size_t v) {
        const auto id = static_cast<VertexId>(v);
        Vec3d sum = Vec3d::Zero();
        double area = 0;
        for (const std::uint32_t* f = faces.begin(id); f != faces.end(id); ++f) {
            const Triangle& t = m.triangles[*f];
            const Vec3d a = m.points[t[0]].cast<double>();
            const Vec3d cross = (m.points[t[1]].cast<double>() - a).cross(m.points[t[2]].cast<double>() - a);
            sum += cross;
            area += cross.norm() / 6;
        }
        const double length = sum.norm();
        normals_[v] = length > 0 ? Vec3f((sum / length).cast<float>()) : Vec3f(Vec3f::Zero());
        areas_[v] = static_cast<float>(area);
    });
}

}  // namespace vdbgeo
