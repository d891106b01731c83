#include "vdbgeo/remesh/delaunay_remesh.h"

#include <fmt/format.h>

#include <cmath>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/delaunay_surface.h"
#include "vdbgeo/surface/mesh_solid.h"
#include "vdbgeo/surface/seeded_delaunay.h"

namespace vdbgeo {
namespace {

void check_input(const TriMesh& mesh, const Progress& progress) {
    const MeshMeasures m = measure_mesh(mesh, progress);
    const auto refuse = [](std::uint64_t count, const char* what) {
        if (count > 0)
            throw InvalidInput(
                fmt::format("Delaunay remeshing needs a closed, oriented manifold: the mesh has {} {}; "
                            "repair may mend that",
                            count, what));
    };
    refuse(m.boundary_edges, "boundary edges");
    refuse(m.non_manifold_edges, "non-manifold edges");
    refuse(m.misoriented_edges, "edges whose faces are turned against each other");
    refuse(m.non_manifold_vertices, "non-manifold vertices");
    refuse(m.degenerate_faces, "faces that name a vertex twice");
}

}  // namespace

void DelaunayRemeshOptions::check() const {
    if (!(angle_deg >= 0 && angle_deg <= 30))
        throw InvalidInput(fmt::format("the angle bound is {:g}°: 0 to 30 are possible", angle_deg));
    if (!(radius > 0 && std::isfinite(radius)))
        throw InvalidInput(fmt::format("the radius bound is {:g} Å: it must be above 0", radius));
    if (!(distance > 0 && std::isfinite(distance)))
        throw InvalidInput(fmt::format("the distance bound is {:g} Å: it must be above 0", distance));
    if (max_vertices < 4 || max_vertices > TriMesh::max_vertices)
        throw InvalidInput(
            fmt::format("the bound on vertices is {}: 4 to 2^32 - 1 are possible", max_vertices));
    if (!(max_seconds > 0 && max_seconds <= 1e8))
        throw InvalidInput(
            fmt::format("the bound on time is {:g} s: above 0 and up to 1e8 are possible", max_seconds));
}

TriMesh delaunay_remesh(const TriMesh& mesh, const DelaunayRemeshOptions& options, const Progress& progress) {
    options.check();
    if (!have_delaunay()) throw InvalidInput("Delaunay remeshing needs CGAL, which this build does not have");
    if (mesh.empty()) return {};
    check_input(mesh, progress.part(0, 0.02));

    Vec3d centre = Vec3d::Zero();
    for (const Vec3f& p : mesh.points) centre += p.cast<double>() / static_cast<double>(mesh.points.size());
    ReferenceMesh reference;
    for (const Vec3f& p : mesh.points) reference.points.push_back(p.cast<double>() - centre);
    reference.triangles = mesh.triangles;
    const MeshSolid solid(reference.points, reference.triangles);
    const Vec3d margin = Vec3d::Constant(options.radius);
    const SeededBounds bounds{options.angle_deg, options.radius, options.distance, options.max_vertices,
                              options.max_seconds};
    const DelaunayMesh found = seeded_delaunay(solid, solid.low() - margin, solid.high() + margin, reference,
                                               bounds, progress.part(0.02, 1));
    TriMesh out;
    for (const Vec3d& p : found.points) out.points.push_back((p + centre).cast<float>());
    for (const Triangle& t : found.triangles) out.triangles.push_back(t);
    return out;
}

}  // namespace vdbgeo
