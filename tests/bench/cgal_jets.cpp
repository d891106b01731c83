#include <CGAL/Monge_via_jet_fitting.h>
#include <CGAL/Simple_cartesian.h>

#include <limits>

#include "tests/bench/curvature_peers.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/core/vertex_neighbours.h"

namespace vdbgeo::bench {

PeerCurvature cgal_jets(const TriMesh& mesh, int degree, int rings) {
    using Kernel = CGAL::Simple_cartesian<double>;
    const VertexNeighbours around(mesh);
    const VertexFaces faces(mesh);
    PeerCurvature out;
    out.mean.resize(mesh.points.size());
    out.gauss.resize(mesh.points.size());
    std::vector<std::size_t> seen(mesh.points.size(), mesh.points.size());
    std::vector<VertexId> patch;
    std::vector<Kernel::Point_3> samples;
    const std::size_t needed = static_cast<std::size_t>((degree + 1) * (degree + 2) / 2);
    for (VertexId v = 0; v < mesh.points.size(); ++v) {
        patch.assign(1, v);
        seen[v] = v;
        for (std::size_t ring = 0, next = 0; ring < static_cast<std::size_t>(rings); ++ring)
            for (const std::size_t end = patch.size(); next < end; ++next)
                for (auto e = around.begin[patch[next]]; e < around.begin[patch[next] + 1]; ++e)
                    if (const VertexId w = around.neighbours[e]; seen[w] != v) {
                        seen[w] = v;
                        patch.push_back(w);
                    }
        if (patch.size() < needed) {
            out.mean[v] = out.gauss[v] = std::numeric_limits<double>::quiet_NaN();
            continue;
        }
        samples.clear();
        for (const VertexId w : patch)
            samples.emplace_back(mesh.points[w].x(), mesh.points[w].y(), mesh.points[w].z());
        Vec3d normal = Vec3d::Zero();
        for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f) {
            const Triangle& t = mesh.triangles[*f];
            const Vec3d a = mesh.points[t[0]].cast<double>();
            normal += (mesh.points[t[1]].cast<double>() - a).cross(mesh.points[t[2]].cast<double>() - a);
        }
        CGAL::Monge_via_jet_fitting<Kernel> fitting;
        auto form = fitting(samples.begin(), samples.end(), static_cast<std::size_t>(degree), 2);
        // Its heights rise along the normal: what bulges outward is negative there.
        form.comply_wrt_given_normal({-normal.x(), -normal.y(), -normal.z()});
        const double a = form.principal_curvatures(0), b = form.principal_curvatures(1);
        out.mean[v] = 0.5 * (a + b);
        out.gauss[v] = a * b;
    }
    return out;
}

}  // namespace vdbgeo::bench
