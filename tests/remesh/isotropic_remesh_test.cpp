#include "vdbgeo/remesh/isotropic_remesh.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/face_adjacency.h"
#include "vdbgeo/measure/mesh_measures.h"

namespace vdbgeo {
namespace {

using test::icosphere;
using test::joined;
using test::torus_mesh;

TriMesh remeshed(const TriMesh& mesh, double length, std::optional<double> feature_angle_deg = {}) {
    IsotropicRemeshOptions options;
    options.target_length = length;
    options.feature_angle_deg = feature_angle_deg;
    return isotropic_remesh(mesh, options);
}

Vec3d corner(const TriMesh& mesh, const Triangle& t, std::size_t k) {
    return mesh.points[t[k % 3]].cast<double>();
}

/// The share of edges within [low, high], each face's counted.
double share_of_edges(const TriMesh& mesh, double low, double high) {
    std::size_t within = 0;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const double length = (corner(mesh, t, k) - corner(mesh, t, k + 1)).norm();
            within += length >= low && length <= high;
        }
    return static_cast<double>(within) / static_cast<double>(3 * mesh.triangles.size());
}

double share_of_angles(const MeshMeasures& measures, std::size_t low, std::size_t high) {
    std::uint64_t within = 0, all = 0;
    for (std::size_t k = 0; k < 180; ++k) {
        all += measures.angle_histogram[k];
        if (k >= low && k < high) within += measures.angle_histogram[k];
    }
    return static_cast<double>(within) / static_cast<double>(all);
}

bool same_bytes(const TriMesh& a, const TriMesh& b) {
    return a.points.size() == b.points.size() && a.triangles.size() == b.triangles.size() &&
           std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Vec3f)) == 0 &&
           std::memcmp(a.triangles.data(), b.triangles.data(), a.triangles.size() * sizeof(Triangle)) == 0;
}

/// The cube [0, size]³, n × n squares a side, split in two.
TriMesh cube_mesh(double size, int n) {
    TriMesh mesh;
    std::map<std::array<int, 3>, VertexId> numbers;
    const auto id = [&](const std::array<int, 3>& c) {
        const auto [it, fresh] = numbers.try_emplace(c, static_cast<VertexId>(mesh.points.size()));
        if (fresh) mesh.points.push_back((Vec3d(c[0], c[1], c[2]) * size / n).cast<float>());
        return it->second;
    };
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const int side : {0, n})
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const auto at = [&](int di, int dj) {
                        std::array<int, 3> c{};
                        c[axis] = side;
                        c[(axis + 1) % 3] = i + di;
                        c[(axis + 2) % 3] = j + dj;
                        return id(c);
                    };
                    Triangle one{at(0, 0), at(1, 0), at(1, 1)}, two{at(0, 0), at(1, 1), at(0, 1)};
                    if (side == 0) std::swap(one[1], one[2]), std::swap(two[1], two[2]);
                    mesh.triangles.push_back(one);
                    mesh.triangles.push_back(two);
                }
    return mesh;
}

double border_length(const TriMesh& mesh) {
    const FaceAdjacency adjacency = face_adjacency(mesh, "test");
    double sum = 0;
    for (std::size_t h = 0; h < adjacency.twin.size(); ++h)
        if (adjacency.twin[h] == FaceAdjacency::none) {
            const Triangle& t = mesh.triangles[h / 3];
            sum += (corner(mesh, t, h % 3) - corner(mesh, t, h % 3 + 1)).norm();
        }
    return sum;
}

TEST(IsotropicRemesh, SphereBecomesEven) {
    const TriMesh in = icosphere(5, 10);
    for (const double length : {0.3, 1.0, 2.5}) {
        const TriMesh out = remeshed(in, length);
        const MeshMeasures m = measure_mesh(out);
        EXPECT_TRUE(m.closed && m.oriented && m.manifold) << length;
        EXPECT_EQ(m.genus, 0);
        EXPECT_GT(m.min_angle_deg, 30) << length;
        EXPECT_GT(share_of_angles(m, 35, 100), 0.99) << length;
        EXPECT_GT(share_of_edges(out, 0.7 * length, 1.4 * length), 0.99) << length;
        EXPECT_NEAR(m.volume_A3.value(), 4 * M_PI / 3 * 1000, 4 * M_PI * 100 * length * length / 40 + 12);
        for (const Vec3f& p : out.points) EXPECT_NEAR(p.norm(), 10, 0.03);
    }
}

TEST(IsotropicRemesh, TorusKeepsItsHandle) {
    const TriMesh out = remeshed(torus_mesh(10, 4), 0.8);
    const MeshMeasures m = measure_mesh(out);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_EQ(m.genus, 1);
    EXPECT_GT(m.min_angle_deg, 30);
    EXPECT_NEAR(m.volume_A3.value(), 2 * M_PI * M_PI * 10 * 16, 60);
}

TEST(IsotropicRemesh, BordersStay) {
    const TriMesh in = test::open_cylinder_mesh(5, 12);
    const TriMesh out = remeshed(in, 0.7);
    const MeshMeasures m = measure_mesh(out);
    EXPECT_TRUE(m.oriented && m.manifold);
    EXPECT_EQ(m.euler_characteristic, 0);
    EXPECT_EQ(m.components, 1u);
    EXPECT_NEAR(border_length(out), border_length(in), 0.01 * border_length(in));
    EXPECT_NEAR(border_length(out), 4 * M_PI * 5, 0.5);
    EXPECT_GT(m.min_angle_deg, 25);
    float low = 0, high = 0;
    for (const Vec3f& p : out.points) low = std::min(low, p.z()), high = std::max(high, p.z());
    EXPECT_FLOAT_EQ(low, -6);
    EXPECT_FLOAT_EQ(high, 6);
}

TEST(IsotropicRemesh, CubeKeepsItsEdgesAndItsVolume) {
    const TriMesh out = remeshed(cube_mesh(10, 16), 1.1, 40);
    const MeshMeasures m = measure_mesh(out);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_NEAR(m.volume_A3.value(), 1000, 1e-3);
    EXPECT_NEAR(m.area_A2, 600, 1e-3);
    EXPECT_GT(m.min_angle_deg, 25);
    // Without, the edges are rounded off: the test can fail.
    EXPECT_LT(measure_mesh(remeshed(cube_mesh(10, 16), 1.1)).volume_A3.value(), 999);
}

TEST(IsotropicRemesh, RimsOfCapsStay) {
    TriMesh in = cube_mesh(10, 16);
    MeshProperty cap{cap_property, 1, {}};
    double cap_area = 0;
    for (const Triangle& t : in.triangles) {
        const Vec3d middle = (corner(in, t, 0) + corner(in, t, 1) + corner(in, t, 2)) / 3;
        // A disc-like patch of the top, with a rim of steps.
        const bool is_cap = middle.z() > 9.99 && std::hypot(middle.x() - 5, middle.y() - 5) < 3.6;
        cap.values.push_back(is_cap);
        if (is_cap)
            cap_area +=
                0.5 * (corner(in, t, 1) - corner(in, t, 0)).cross(corner(in, t, 2) - corner(in, t, 0)).norm();
    }
    in.face_properties.push_back(cap);
    const TriMesh out = remeshed(in, 0.8, 40);
    const MeshProperty* found = out.find_face_property(cap_property);
    ASSERT_NE(found, nullptr);
    ASSERT_EQ(found->values.size(), out.triangles.size());
    double area = 0;
    for (std::size_t f = 0; f < out.triangles.size(); ++f) {
        const Triangle& t = out.triangles[f];
        EXPECT_TRUE(found->values[f] == 0 || found->values[f] == 1);
        if (found->values[f] == 0) continue;
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_NEAR(corner(out, t, k).z(), 10, 1e-5);
            EXPECT_LT(std::hypot(corner(out, t, k).x() - 5, corner(out, t, k).y() - 5), 4.3);
        }
        area +=
            0.5 * (corner(out, t, 1) - corner(out, t, 0)).cross(corner(out, t, 2) - corner(out, t, 0)).norm();
    }
    EXPECT_NEAR(area, cap_area, 0.03 * cap_area);
}

TEST(IsotropicRemesh, SmallPiecesSurvive) {
    const TriMesh tiny = test::moved(icosphere(1, 0.2), Mat3d::Identity(), Vec3d(20, 0, 0));
    const TriMesh dust = test::moved(icosphere(0, 0.05), Mat3d::Identity(), Vec3d(-20, 0, 0));
    const TriMesh out = remeshed(joined(joined(icosphere(4, 8), tiny), dust), 1);
    const MeshMeasures m = measure_mesh(out);
    EXPECT_EQ(m.components, 3u);
    EXPECT_EQ(m.euler_characteristic, 6);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    double far = 0;
    for (const Triangle& t : out.triangles)
        if (corner(out, t, 0).x() > 15)
            far += corner(out, t, 0).dot(corner(out, t, 1).cross(corner(out, t, 2))) / 6;
    EXPECT_GT(far, 0.7 * measure_mesh(tiny).volume_A3.value());
}

TEST(IsotropicRemesh, TwoSheetsThatAreCloserThanAnEdgeStayApart) {
    const TriMesh in = joined(icosphere(5, 10), test::flipped(icosphere(5, 9.7)));
    const TriMesh out = remeshed(in, 0.9);
    const MeshMeasures m = measure_mesh(out);
    EXPECT_EQ(m.components, 2u);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    for (const Triangle& t : out.triangles) {
        const bool outer = corner(out, t, 0).norm() > 9.85;
        for (std::size_t k = 1; k < 3; ++k) EXPECT_EQ(corner(out, t, k).norm() > 9.85, outer);
    }
}

TEST(IsotropicRemesh, LengthsFollowTheCurvature) {
    // An ellipsoid: flat at the poles of z, curved around the equator.
    TriMesh in = icosphere(5, 1);
    for (Vec3f& p : in.points) p = Vec3f(12 * p.x(), 12 * p.y(), 4 * p.z());
    IsotropicRemeshOptions options;
    options.adaptive = CurvatureSizing{0.3, 5, 0.05};
    const TriMesh out = isotropic_remesh(in, options);
    const MeshMeasures m = measure_mesh(out);
    EXPECT_TRUE(m.closed && m.oriented && m.manifold);
    EXPECT_EQ(m.genus, 0);
    EXPECT_GT(m.min_angle_deg, 20);
    double pole = 0, equator = 0, worst = 0;
    int poles = 0, equators = 0;
    for (const Triangle& t : out.triangles) {
        const Vec3d middle = (corner(out, t, 0) + corner(out, t, 1) + corner(out, t, 2)) / 3;
        const double length = (corner(out, t, 0) - corner(out, t, 1)).norm(),
                     flat = std::hypot(middle.x(), middle.y());
        if (flat < 3) pole += length, ++poles;
        if (flat > 11.2) equator += length, ++equators;
        // How far the middle lies below the surface, to first order.
        const Vec3d g(middle.x() / 144, middle.y() / 144, middle.z() / 16);
        worst = std::max(worst, (1 - middle.dot(g)) / (2 * g.norm()));
    }
    EXPECT_GT(pole / poles, 1.8 * equator / equators);
    EXPECT_LT(worst, 3 * 0.05);
    EXPECT_LT(out.triangles.size(), in.triangles.size() / 2);
}

TEST(IsotropicRemesh, VertexAndFacePropertiesComeFromTheInput) {
    TriMesh in = icosphere(5, 10);
    MeshProperty linear{"linear", 3, {}}, half{"half", 1, {}};
    for (const Vec3f& p : in.points)
        for (int k = 0; k < 3; ++k) linear.values.push_back(2 * p[k] + 1);
    for (const Triangle& t : in.triangles) half.values.push_back(corner(in, t, 0).z() > 0 ? 7.0f : 3.0f);
    in.vertex_properties.push_back(linear);
    in.face_properties.push_back(half);
    const TriMesh out = remeshed(in, 0.9);
    check(out, "remeshed");
    const MeshProperty* found = out.find_vertex_property("linear");
    ASSERT_NE(found, nullptr);
    for (std::size_t v = 0; v < out.points.size(); ++v)
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_NEAR(found->values[3 * v + k], 2 * out.points[v][static_cast<int>(k)] + 1, 1e-3);
    const MeshProperty* side = out.find_face_property("half");
    ASSERT_NE(side, nullptr);
    for (std::size_t f = 0; f < out.triangles.size(); ++f) {
        const Triangle& t = out.triangles[f];
        const double z = (corner(out, t, 0).z() + corner(out, t, 1).z() + corner(out, t, 2).z()) / 3;
        if (std::abs(z) > 1) {
            EXPECT_EQ(side->values[f], z > 0 ? 7 : 3);
        }
    }
}

TEST(IsotropicRemesh, SameBytesForAnyNumberOfThreads) {
    const TriMesh in = torus_mesh(10, 4);
    TriMesh one, two;
    {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
        one = remeshed(in, 0.7);
    }
    {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 2);
        two = remeshed(in, 0.7);
    }
    EXPECT_TRUE(same_bytes(one, two));
    EXPECT_FALSE(same_bytes(one, in));
}

TEST(IsotropicRemesh, NothingToDo) {
    EXPECT_TRUE(isotropic_remesh({}).triangles.empty());
    const TriMesh in = icosphere(2, 3);
    IsotropicRemeshOptions options;
    options.iterations = 0;
    EXPECT_TRUE(same_bytes(isotropic_remesh(in, options), in));
}

/// The message of what is thrown.
std::string refusal(const TriMesh& mesh, const IsotropicRemeshOptions& options = {}) {
    try {
        isotropic_remesh(mesh, options);
    } catch (const InvalidInput& e) {
        return e.what();
    }
    return {};
}

TEST(IsotropicRemesh, RefusesWhatIsNoManifold) {
    TriMesh fin = icosphere(2, 3);
    fin.points.emplace_back(9, 9, 9);
    fin.triangles.push_back(
        {fin.triangles[0][0], fin.triangles[0][1], static_cast<VertexId>(fin.points.size() - 1)});
    EXPECT_EQ(refusal(fin), "remesh needs a manifold mesh: 3 faces cannot be added; try repair");
    TriMesh turned = icosphere(2, 3);
    std::swap(turned.triangles[5][0], turned.triangles[5][1]);
    EXPECT_NE(refusal(turned).find("needs a manifold mesh: 4 faces"), std::string::npos);
    TriMesh twice = icosphere(2, 3);
    twice.triangles[7][1] = twice.triangles[7][0];
    EXPECT_NE(refusal(twice).find("needs a manifold mesh"), std::string::npos);
    TriMesh touching =
        joined(icosphere(0, 3), test::moved(icosphere(0, 3), Mat3d::Identity(), Vec3d(20, 0, 0)));
    for (Triangle& t : touching.triangles)
        for (VertexId& v : t)
            if (v == 12) v = 0;
    EXPECT_NE(refusal(touching).find("needs a manifold mesh: 10 faces"), std::string::npos);
}

TEST(IsotropicRemesh, RefusesOptionsByName) {
    const TriMesh in = icosphere(1, 3);
    IsotropicRemeshOptions options;
    options.target_length = -1;
    EXPECT_NE(refusal(in, options).find("target length -1"), std::string::npos);
    options.target_length = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NE(refusal(in, options).find("target length"), std::string::npos);
    options.target_length = 1e-7;
    EXPECT_NE(refusal(in, options).find("more than 3e8"), std::string::npos);
    options = {};
    options.iterations = -2;
    EXPECT_NE(refusal(in, options).find("-2 iterations"), std::string::npos);
    options = {};
    options.feature_angle_deg = 180;
    EXPECT_NE(refusal(in, options).find("feature angle"), std::string::npos);
    options = {};
    options.adaptive = CurvatureSizing{2, 1, 0.1};
    EXPECT_NE(refusal(in, options).find("above the greatest"), std::string::npos);
}

}  // namespace
}  // namespace vdbgeo
