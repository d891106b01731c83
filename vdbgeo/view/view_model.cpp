#include "vdbgeo/view/view_model.h"

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"

namespace vdbgeo {
namespace {

/// Sums of the facets' normals e × f / (|e|² |f|²) over the corners with edges e and f (Max 1999), which is
/// exact on a sphere and lets the skinny triangles of marching cubes have their say: by area the large ones
/// beside them win, and the faces show. A point without area round it keeps zero.
Array<Vec3f> vertex_normals(const ViewModel& model) {
    constexpr double floor = 1e-10;  // edges under 1e-5 radii are too short for single precision
    std::vector<Vec3d> sums(model.points.size(), Vec3d::Zero());
    for (const Triangle& t : *model.triangles) {
        const Vec3d a = model.points[t[0]].cast<double>(), ab = model.points[t[1]].cast<double>() - a,
                    ac = model.points[t[2]].cast<double>() - a;
        const Vec3d cross = ab.cross(ac);
        const double c2 = ab.squaredNorm() + floor, b2 = ac.squaredNorm() + floor,
                     a2 = (ac - ab).squaredNorm() + floor;
        sums[t[0]] += cross / (b2 * c2);
        sums[t[1]] += cross / (a2 * c2);
        sums[t[2]] += cross / (a2 * b2);
    }
    Array<Vec3f> normals(sums.size());
    parallel_for(sums.size(), 4096,
                 [&](std::size_t i) { normals[i] = sums[i].stableNormalized().cast<float>(); });
    return normals;
}

}  // namespace

ViewModel make_view_model(const TriMesh& mesh) {
    ViewModel model;
    Vec3d low = Vec3d::Constant(1e300), high = -low;
    for (const Triangle& t : mesh.triangles)
        for (const VertexId v : t) {
            low = low.cwiseMin(mesh.points[v].cast<double>());
            high = high.cwiseMax(mesh.points[v].cast<double>());
        }
    model.centre = (low + high) / 2;
    model.radius = (high - low).norm() / 2;
    if (!(model.radius > 0)) throw InvalidInput("the mesh has no extent: all its points coincide");
    model.triangles = &mesh.triangles;
    model.points.resize(mesh.points.size());
    parallel_for(mesh.points.size(), 4096, [&](std::size_t i) {
        model.points[i] = ((mesh.points[i].cast<double>() - model.centre) / model.radius).cast<float>();
    });
    model.normals = vertex_normals(model);
    return model;
}

ViewBox box_in_view(const ViewModel& model, const View& view) {
    Mat3d axes;
    axes << view.right, view.up, view.towards;
    const ViewBox nothing{Vec3d::Constant(1e300), Vec3d::Constant(-1e300)};
    const auto& triangles = *model.triangles;
    return fixed_order_reduce(
        triangles.size(), 4096, nothing,
        [&](std::size_t begin, std::size_t end) {
            ViewBox box = nothing;
            for (std::size_t f = begin; f < end; ++f)
                for (const VertexId v : triangles[f]) {
                    const Vec3d p = axes.transpose() * model.points[v].cast<double>() * model.radius;
                    box.low = box.low.cwiseMin(p);
                    box.high = box.high.cwiseMax(p);
                }
            return box;
        },
        [](ViewBox& all, const ViewBox& part) {
            all.low = all.low.cwiseMin(part.low);
            all.high = all.high.cwiseMax(part.high);
        });
}

}  // namespace vdbgeo
