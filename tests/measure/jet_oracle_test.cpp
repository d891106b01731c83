// Jets beside CGAL's. A program of its own: CGAL's targets bring -frounding-math.
#include <CGAL/Monge_via_jet_fitting.h>
#include <CGAL/Simple_cartesian.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/meshes.h"
#include "vdbgeo/measure/jet_curvature.h"
#include "vdbgeo/measure/vertex_patch.h"

namespace vdbgeo {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;

struct Jet {
    double k1, k2;
    Vec3d direction1;
};

/// CGAL's fit to the same points, in the frame of their principal components.
Jet cgal_jet(const TriMesh& mesh, const std::vector<VertexPatch::Member>& members, int degree,
             const Vec3d& normal) {
    std::vector<Kernel::Point_3> points;
    for (const auto& m : members) {
        const Vec3d p = mesh.points[m.vertex].cast<double>();
        points.emplace_back(p[0], p[1], p[2]);
    }
    CGAL::Monge_via_jet_fitting<Kernel> fit;
    auto form = fit(points.begin(), points.end(), static_cast<std::size_t>(degree), 2);
    form.comply_wrt_given_normal(Kernel::Vector_3(normal[0], normal[1], normal[2]));
    // CGAL's curvatures are those of the height above the tangent plane: negative on a sphere with this
    // normal.
    const auto d = form.minimal_principal_direction();
    return {-form.principal_curvatures(1), -form.principal_curvatures(0), Vec3d(d.x(), d.y(), d.z())};
}

/// For surfaces around the origin. The largest difference of k1 and k2 in proportion to the larger, and the
/// least cosine between directions where the curvatures differ by a tenth.
void compare(const TriMesh& mesh, int degree, int rings, double tolerance, double least_cosine) {
    JetOptions options;
    options.degree = degree;
    options.rings = rings;
    const Curvatures ours = jet_curvature(mesh, options);
    const VertexNeighbours neighbours(mesh);
    VertexPatch patch(mesh, neighbours);
    double worst = 0, cosine = 1;
    for (VertexId v = 0; v < mesh.points.size(); v += 7) {
        ASSERT_TRUE(ours.defined(v));
        const Vec3d normal =
            ours.direction1[v].cast<double>().cross(ours.direction2[v].cast<double>()).normalized();
        const Vec3d out = mesh.points[v].cast<double>();
        // Outward is where the jet's normal agrees with the sign of ours: tried both ways by the caller's
        // shape.
        const Jet theirs =
            cgal_jet(mesh, patch.rings(v, rings), degree, normal.dot(out) < 0 ? Vec3d(-normal) : normal);
        const double size = std::max(std::abs(ours.k1[v]), std::abs(ours.k2[v]));
        worst = std::max(
            {worst, std::abs(ours.k1[v] - theirs.k1) / size, std::abs(ours.k2[v] - theirs.k2) / size});
        if (ours.k1[v] - ours.k2[v] > 0.1 * size)
            cosine = std::min(cosine, std::abs(theirs.direction1.dot(ours.direction1[v].cast<double>())));
    }
    EXPECT_LT(worst, tolerance) << "degree " << degree;
    EXPECT_GT(cosine, least_cosine) << "degree " << degree;
}

/// A closed surface that every ray from the origin meets once, with three different axes.
TriMesh ellipsoid(int subdivisions) {
    TriMesh mesh = test::icosphere(subdivisions, 1);
    for (Vec3f& p : mesh.points) p = p.cwiseProduct(Vec3f(1, 1.3f, 1.7f));
    return mesh;
}

TEST(JetOracle, AgreesWithCgalOnASmoothSurface) {
    // Frames differ by the distance of the mean normal from the plane of the points: of second order.
    compare(ellipsoid(4), 2, 2, 5e-3, 0.999);
    compare(ellipsoid(4), 3, 2, 5e-3, 0.999);
    compare(ellipsoid(4), 4, 2, 5e-3, 0.999);
    compare(ellipsoid(4), 4, 3, 5e-3, 0.999);
}

TEST(JetOracle, AgreesWithCgalUnderNoise) {
    TriMesh mesh = ellipsoid(4);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> jump(-0.002f, 0.002f);
    for (Vec3f& p : mesh.points) p += Vec3f(jump(random), jump(random), jump(random));
    compare(mesh, 2, 3, 0.02, 0.99);
}

TEST(JetOracle, AgreesExactlyWhereFramesDo) {
    // Vertices of an icosahedron have fivefold symmetry: one frame, the same jet.
    const TriMesh mesh = test::icosphere(3, 2);
    const VertexNeighbours neighbours(mesh);
    VertexPatch patch(mesh, neighbours);
    for (const int degree : {2, 4}) {
        JetOptions options;
        options.degree = degree;
        const Curvatures ours = jet_curvature(mesh, options);
        for (VertexId v = 0; v < 12; ++v) {
            const Jet theirs = cgal_jet(mesh, patch.rings(v, 2), degree, mesh.points[v].cast<double>());
            EXPECT_NEAR(ours.k1[v], theirs.k1, 1e-6);
            EXPECT_NEAR(ours.k2[v], theirs.k2, 1e-6);
        }
    }
}

}  // namespace
}  // namespace vdbgeo
