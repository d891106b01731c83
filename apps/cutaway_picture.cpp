#include "apps/cutaway_picture.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace vdbgeo::app {

Vec3d normal_across(const std::string& axis) {
    if (axis == "x") return Vec3d::UnitX();
    if (axis == "y") return -Vec3d::UnitY();
    if (axis == "z") return Vec3d::UnitZ();
    return Vec3d::Zero();
}

CutawayOptions::Plane plane_at(const TetMesh& mesh, const Vec3d& normal, double part, bool whole_tets) {
    double first = std::numeric_limits<double>::infinity(), last = -first;
    for (const Tetrahedron& t : mesh.tets)
        for (const VertexId v : t) {
            const double along = normal.dot(mesh.points[v]);
            first = std::min(first, along), last = std::max(last, along);
        }
    return {(first + part * (last - first)) * normal, normal, whole_tets};
}

std::string view_onto(const TriMesh& opened) {
    const MeshProperty* interior = opened.find_face_property(interior_property);
    Vec3d opening = Vec3d::Zero();
    for (std::size_t f = 0; f < opened.triangles.size(); ++f) {
        if (!(interior->values[f] > 0)) continue;
        const Triangle& t = opened.triangles[f];
        const Vec3d a = opened.points[t[0]].cast<double>();
        opening += (opened.points[t[1]].cast<double>() - a).cross(opened.points[t[2]].cast<double>() - a);
    }
    if (!(opening.norm() > 0)) return "iso";
    opening.normalize();
    const Vec3d up = opening.head<2>().norm() > 0.1 ? Vec3d::UnitZ() : Vec3d::UnitY();
    const Vec3d right = up.cross(opening).normalized();
    const Vec3d v = (opening + 0.35 * right + 0.3 * opening.cross(right)).normalized();
    return fmt::format("{:.2f},{:.2f},{:.2f}", v.x(), v.y(), v.z());
}

void set_cut_colours(RenderOptions& render, const std::string& property) {
    const auto range = [&](double low, double high) {
        if (!render.range_min) render.range_min = low;
        if (!render.range_max) render.range_max = high;
    };
    render.property = property;
    if (property == "min_dihedral_deg") range(0, 70);
    if (property == "radius_edge") range(0.6, 2);
}

TriMesh shown_cut(TriMesh opened, const std::string& property) {
    const std::vector<float> interior = opened.find_face_property(interior_property)->values;
    opened.vertex_properties.clear();
    // Regions tell something of the old boundary too.
    for (MeshProperty& p : opened.face_properties)
        if (p.name == property && p.components == 1 && p.name != "region")
            for (std::size_t f = 0; f < interior.size(); ++f)
                if (!(interior[f] > 0)) p.values[f] = std::numeric_limits<float>::quiet_NaN();
    return opened;
}

}  // namespace vdbgeo::app
