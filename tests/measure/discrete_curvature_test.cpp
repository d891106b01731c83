#include "vdbgeo/measure/discrete_curvature.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "converters/mesh_file.h"
#include "tests/support/data.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/vertex_faces.h"
#include "vdbgeo/measure/mesh_measures.h"

namespace vdbgeo {
namespace {

using test::mesh_of;

constexpr DualArea kinds[] = {DualArea::barycentric, DualArea::voronoi, DualArea::mixed};

double total_curvature(const DiscreteCurvature& c) {
    double sum = 0;
    for (std::size_t v = 0; v < c.size(); ++v)
        if (c.dual_area[v] != 0) sum += c.K[v] * c.dual_area[v];
    return sum;
}

double total_area(const DiscreteCurvature& c) {
    return std::accumulate(c.dual_area.begin(), c.dual_area.end(), 0.0);
}

/// Cubes of a grid with `genus` tunnels through a slab, rounded by averaging: no special angles.
TriMesh slab_with_tunnels(int genus) {
    const int n = 2 * genus + 1;
    TriMesh all =
        test::cells_mesh(n, [&](int x, int y, int z) { return y < 3 && z == 0 && !(y == 1 && x % 2 == 1); });
    const VertexFaces faces(all);
    TriMesh out;
    std::vector<VertexId> number(all.points.size());
    for (VertexId v = 0; v < all.points.size(); ++v) {
        number[v] = static_cast<VertexId>(out.points.size());
        if (faces.begin(v) == faces.end(v)) continue;
        Vec3f mean = Vec3f::Zero();
        for (const std::uint32_t* f = faces.begin(v); f != faces.end(v); ++f)
            for (const VertexId w : all.triangles[*f])
                mean += all.points[w] / float(3 * (faces.end(v) - faces.begin(v)));
        out.points.push_back(mean);
    }
    for (Triangle t : all.triangles) {
        for (VertexId& v : t) v = number[v];
        out.triangles.push_back(t);
    }
    return out;
}

/// Eqs 13 to 15 as they are written: by edges and angles, without any of the short cuts.
struct Twin {
    std::vector<double> K, H, area;

    Twin(const TriMesh& mesh, DualArea kind) {
        const std::size_t n = mesh.points.size();
        std::vector<double> angles(n), full(n, 0.0);
        std::vector<Vec3d> laplacian(n, Vec3d::Zero()), normal(n, Vec3d::Zero());
        std::map<std::pair<VertexId, VertexId>, double> cotangents;
        std::map<std::pair<VertexId, VertexId>, int> count;
        area.assign(n, 0);
        const auto at = [&](VertexId v) { return Vec3d(mesh.points[v].cast<double>()); };
        const auto angle = [&](VertexId at_v, VertexId b, VertexId c) {
            return std::acos(
                std::clamp((at(b) - at(at_v)).normalized().dot((at(c) - at(at_v)).normalized()), -1.0, 1.0));
        };
        for (const Triangle& t : mesh.triangles) {
            const Vec3d cross = (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]));
            bool obtuse = false;
            for (std::size_t k = 0; k < 3; ++k)
                obtuse |= angle(t[k], t[(k + 1) % 3], t[(k + 2) % 3]) > M_PI / 2;
            for (std::size_t k = 0; k < 3; ++k) {
                const VertexId v = t[k], w = t[(k + 1) % 3], u = t[(k + 2) % 3];
                const double theta = angle(v, w, u);
                angles[v] += theta;
                normal[v] += cross;
                cotangents[std::minmax(w, u)] += 1 / std::tan(theta);
                ++count[std::minmax(w, u)];
                if (kind == DualArea::barycentric) area[v] += cross.norm() / 6;
                if (kind == DualArea::mixed) {
                    const double at_w = 1 / std::tan(angle(w, u, v)), at_u = 1 / std::tan(angle(u, v, w));
                    if (!obtuse)
                        area[v] +=
                            (at_u * (at(w) - at(v)).squaredNorm() + at_w * (at(u) - at(v)).squaredNorm()) / 8;
                    else
                        area[v] += cross.norm() / (theta > M_PI / 2 ? 4 : 8);
                }
            }
        }
        std::vector<bool> border(n, false);
        for (const auto& [edge, cotangent] : cotangents)
            for (const auto& [v, w] : {edge, std::pair(edge.second, edge.first)}) {
                laplacian[v] += cotangent * (at(v) - at(w));
                if (kind == DualArea::voronoi) area[v] += cotangent * (at(v) - at(w)).squaredNorm() / 8;
                if (count[edge] == 1) border[v] = true;
            }
        for (std::size_t v = 0; v < n; ++v) {
            K.push_back(((border[v] ? 1 : 2) * M_PI - angles[v]) / area[v]);
            const double size =
                border[v] ? std::abs(laplacian[v].dot(normal[v].normalized())) : laplacian[v].norm();
            H.push_back(std::copysign(size / (4 * area[v]), laplacian[v].dot(normal[v])));
        }
    }
};

TriMesh bumpy(TriMesh mesh, double by, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> push(-float(by), float(by));
    for (Vec3f& p : mesh.points) p += Vec3f(push(random), push(random), push(random));
    return mesh;
}

void expect_twin(const TriMesh& mesh) {
    for (const DualArea kind : kinds) {
        const DiscreteCurvature c = discrete_curvature(mesh, {kind});
        const Twin twin(mesh, kind);
        for (std::size_t v = 0; v < c.size(); ++v) {
            const double scale = 1 / std::abs(twin.area[v]);
            EXPECT_NEAR(c.K[v], twin.K[v], 1e-6 * scale) << v;
            EXPECT_NEAR(c.H[v], twin.H[v], 1e-9 * scale) << v;
            EXPECT_NEAR(c.dual_area[v], twin.area[v], 1e-9);
            EXPECT_GE(c.k1[v], c.k2[v]);
            EXPECT_NEAR(c.k1[v] + c.k2[v], 2 * c.H[v], 1e-12 * scale);
        }
    }
}

TEST(DiscreteCurvature, IsTheEquationsAsWritten) {
    expect_twin(bumpy(test::icosphere(2, 3), 0.1, 1));
    expect_twin(bumpy(test::torus_mesh(4, 1.5, 20, 12), 0.05, 2));
    expect_twin(test::flipped(bumpy(test::icosphere(1, 2), 0.2, 3)));
    expect_twin(bumpy(test::open_cylinder_mesh(2, 5, 6, 14), 0.1, 4));
}

TEST(DiscreteCurvature, TotalCurvatureIsTheEulerNumber) {
    struct Case {
        TriMesh mesh;
        double characteristic;
    };
    const Case cases[] = {
        {bumpy(test::icosphere(3, 10), 0.3, 5), 2},
        {bumpy(test::torus_mesh(25, 10), 0.2, 6), 0},
        {slab_with_tunnels(1), 0},
        {slab_with_tunnels(4), -6},
        {test::cube(), 2},
        {test::joined(test::icosphere(2, 1), test::torus_mesh(5, 1)), 2},
        {bumpy(test::open_cylinder_mesh(2, 5), 0.01, 7), 0},
    };
    for (const Case& c : cases)
        for (const DualArea kind : kinds) {
            const double expected = 2 * M_PI * c.characteristic;
            const DiscreteCurvature curvature = discrete_curvature(c.mesh, {kind});
            EXPECT_NEAR(total_curvature(curvature), expected, 1e-9 * std::max(1.0, std::abs(expected)));
            EXPECT_NEAR(total_area(curvature), measure_mesh(c.mesh).area_A2,
                        1e-12 * measure_mesh(c.mesh).area_A2);
        }
}

TEST(DiscreteCurvature, TotalCurvatureOfADisc) {
    TriMesh mesh = test::icosphere(3, 5);
    mesh.triangles.resize(mesh.triangles.size() / 4);  // some of the icosahedron's faces: a disc
    const DiscreteCurvature c = discrete_curvature(mesh);
    double sum = 0;
    for (std::size_t v = 0; v < c.size(); ++v)
        if (c.defined(v)) sum += c.K[v] * c.dual_area[v];
    EXPECT_NEAR(sum, 2 * M_PI * static_cast<double>(measure_mesh(mesh).euler_characteristic), 1e-9);
}

TEST(DiscreteCurvature, AngleDefectsOfPolyhedra) {
    const DiscreteCurvature cube = discrete_curvature(test::cube({3, -2, 7}, 2));
    for (std::size_t v = 0; v < 8; ++v) EXPECT_NEAR(cube.K[v] * cube.dual_area[v], M_PI / 2, 1e-14);
    const DiscreteCurvature corner = discrete_curvature(test::tetrahedron());
    EXPECT_NEAR(corner.K[0] * corner.dual_area[0], M_PI / 2, 1e-14);
    for (std::size_t v = 1; v < 4; ++v)
        EXPECT_NEAR(corner.K[v] * corner.dual_area[v], 2 * M_PI - M_PI / 2 - M_PI / 3, 1e-14);
}

TEST(DiscreteCurvature, ManyAnglesAroundAVertex) {
    // A fan that goes three times round a saddle: the angle at the middle is about 6 π.
    TriMesh mesh;
    const int n = 61;
    mesh.points.emplace_back(0.f, 0.f, 0.f);
    for (int i = 0; i < n; ++i) {
        const double u = 6 * M_PI * i / n;
        mesh.points.emplace_back(float(std::cos(u)), float(std::sin(u)), 0.f);
    }
    for (int i = 0; i < n; ++i) mesh.triangles.push_back({0, VertexId(1 + i), VertexId(1 + (i + 1) % n)});
    const DiscreteCurvature c = discrete_curvature(mesh);
    ASSERT_TRUE(c.defined(0));
    EXPECT_NEAR(c.K[0] * c.dual_area[0], 2 * M_PI - 6 * M_PI, 1e-6);
}

TEST(DiscreteCurvature, SpheresArePositiveOutsideAndNegativeInside) {
    const TriMesh sphere = test::icosphere(4, 20);
    const DiscreteCurvature out = discrete_curvature(sphere), in = discrete_curvature(test::flipped(sphere));
    for (std::size_t v = 0; v < out.size(); ++v) {
        EXPECT_NEAR(out.H[v], 1 / 20.0, 1e-3);
        EXPECT_NEAR(out.K[v], 1 / 400.0, 1e-4);
        EXPECT_EQ(out.flags[v], 0);
        EXPECT_DOUBLE_EQ(in.H[v], -out.H[v]);
        EXPECT_DOUBLE_EQ(in.K[v], out.K[v]);
        EXPECT_DOUBLE_EQ(in.k1[v], -out.k2[v]);
    }
    EXPECT_FALSE(out.has_directions());
}

TEST(DiscreteCurvature, ScalesWithTheMesh) {
    const TriMesh mesh = bumpy(test::icosphere(2, 1), 0.05, 8);
    const DiscreteCurvature one = discrete_curvature(mesh);
    for (const float scale : {1e-12f, 1e12f, 1e-25f}) {
        TriMesh scaled = mesh;
        for (Vec3f& p : scaled.points) p *= scale;
        const DiscreteCurvature c = discrete_curvature(scaled);
        for (std::size_t v = 0; v < c.size(); ++v) {
            EXPECT_NEAR(c.H[v] * scale, one.H[v], 1e-4);
            EXPECT_NEAR(c.K[v] * scale * scale, one.K[v], 1e-4);
        }
    }
}

/// A square pyramid's side view: middle of an edge split on one side only leaves a face without area.
TriMesh with_flat_face() {
    TriMesh mesh = test::tetrahedron();
    mesh.points.push_back({0.5f, 0.f, 0.f});  // on the edge 0 1
    mesh.triangles = {{0, 2, 4}, {4, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 4, 1}};
    return mesh;
}

TEST(DiscreteCurvature, AFaceWithoutAreaCountsWithItsLimit) {
    for (const DualArea kind : kinds) {
        const DiscreteCurvature c = discrete_curvature(with_flat_face(), {kind}),
                                whole = discrete_curvature(test::tetrahedron(), {kind});
        EXPECT_NEAR(total_curvature(c), 4 * M_PI, 1e-12);
        EXPECT_NEAR(c.K[4], 0, 1e-12);
        for (std::size_t v = 0; v < 4; ++v)
            EXPECT_NEAR(c.K[v] * c.dual_area[v], whole.K[v] * whole.dual_area[v], 1e-12);
        for (std::size_t v = 0; v < 5; ++v) EXPECT_TRUE(std::isfinite(c.H[v]));
    }
    TriMesh coincident = with_flat_face();
    coincident.points[4] = coincident.points[0];
    const DiscreteCurvature c = discrete_curvature(coincident);
    EXPECT_NEAR(total_curvature(c), 4 * M_PI, 1e-12);
}

TEST(DiscreteCurvature, IsolatedVerticesAndSmallMeshes) {
    TriMesh mesh = test::icosphere(1, 1);
    mesh.points.insert(mesh.points.begin(), Vec3f(50, 50, 50));
    for (Triangle& t : mesh.triangles)
        for (VertexId& v : t) ++v;
    DiscreteCurvature c = discrete_curvature(mesh);
    EXPECT_EQ(c.flags[0], curvature_undefined);
    EXPECT_TRUE(std::isnan(c.K[0]) && std::isnan(c.H[0]) && std::isnan(c.k1[0]) && std::isnan(c.k2[0]));
    EXPECT_EQ(c.dual_area[0], 0);
    for (std::size_t v = 1; v < c.size(); ++v) EXPECT_TRUE(c.defined(v));

    EXPECT_EQ(discrete_curvature(TriMesh()).size(), 0u);

    // Two faces back to back: a closed mesh of the topology of a sphere.
    c = discrete_curvature(mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}}));
    EXPECT_NEAR(total_curvature(c), 4 * M_PI, 1e-12);
    for (std::size_t v = 0; v < 3; ++v) EXPECT_EQ(c.flags[v], 0);

    // Two faces side by side.
    c = discrete_curvature(mesh_of({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}));
    EXPECT_NEAR(total_curvature(c), 2 * M_PI, 1e-12);
    for (std::size_t v = 0; v < 4; ++v) {
        EXPECT_EQ(c.flags[v], curvature_border);
        EXPECT_NEAR(c.H[v], 0, 1e-15);
    }
}

TEST(DiscreteCurvature, RefusesWhatHasNoSides) {
    EXPECT_THROW(discrete_curvature(test::moebius(12)), InvalidInput);
    TriMesh turned = test::icosphere(1, 1);
    std::swap(turned.triangles[7][0], turned.triangles[7][1]);
    EXPECT_THROW(discrete_curvature(turned), InvalidInput);
    EXPECT_THROW(curvature_flags(turned, "x"), InvalidInput);
    TriMesh bad = test::icosphere(1, 1);
    bad.triangles[0][0] = 1000;
    EXPECT_THROW(discrete_curvature(bad), InvalidInput);
    bad = test::icosphere(1, 1);
    bad.points[0][0] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(discrete_curvature(bad), InvalidInput);
}

TEST(DiscreteCurvature, RefusesCoordinatesTooFarOut) {
    const TriMesh sphere = test::icosphere(2, 1);  // edges of about 0.3
    const auto far = [&](double x) { return test::moved(sphere, Mat3d::Identity(), Vec3d(x, 0, 0)); };
    EXPECT_THROW(discrete_curvature(far(1e6)), InvalidInput);
    EXPECT_NO_THROW(discrete_curvature(far(1e3)));
    // An unused point far out is not the surface's.
    TriMesh mesh = sphere;
    mesh.points.emplace_back(1e6f, 0.f, 0.f);
    EXPECT_NO_THROW(discrete_curvature(mesh));
}

TEST(DiscreteCurvature, NonManifoldVerticesAreUndefined) {
    const DiscreteCurvature corner = discrete_curvature(test::two_cubes_sharing_a_vertex());
    for (std::size_t v = 0; v < corner.size(); ++v)  // 7 is both cubes' corner, 8 is left without faces
        EXPECT_EQ(corner.flags[v], v == 7 || v == 8 ? curvature_undefined : 0);
    EXPECT_TRUE(std::isnan(corner.K[7]));
    const DiscreteCurvature edge = discrete_curvature(test::two_cubes_sharing_an_edge());
    for (const std::size_t v : {3u, 7u}) EXPECT_FALSE(edge.defined(v));
}

TEST(DiscreteCurvature, CapsAreLeftOut) {
    // The lid of an open box as a cap: its rim is a border, and what only the lid has is no specimen.
    TriMesh box = test::icosphere(3, 5);
    MeshProperty caps{cap_property, 1, {}};
    TriMesh open = box;
    open.triangles.clear();
    for (const Triangle& t : box.triangles) {
        bool cap = true;
        for (const VertexId v : t) cap &= box.points[v].z() > 2;
        caps.values.push_back(cap);
        if (!cap) open.triangles.push_back(t);
    }
    box.face_properties.push_back(caps);
    const DiscreteCurvature c = discrete_curvature(box), expected = discrete_curvature(open);
    std::size_t borders = 0, lids = 0;
    for (std::size_t v = 0; v < c.size(); ++v) {
        borders += c.flags[v] == curvature_border;
        if (c.flags[v] & curvature_cap) {
            ++lids;
            EXPECT_TRUE(std::isnan(c.K[v]));
            continue;
        }
        EXPECT_EQ(c.flags[v], expected.flags[v]);
        EXPECT_EQ(c.K[v], expected.K[v]);
        EXPECT_EQ(c.H[v], expected.H[v]);
    }
    EXPECT_GT(borders, 10u);
    EXPECT_GT(lids, 50u);
}

TEST(DiscreteCurvature, FlagsDoNotDependOnHowTheyAreFound) {
    // The quick walk round a fan against the general way: a vertex of more than 32 faces takes the latter.
    for (const int n : {3, 8, 31, 32, 33, 70})
        for (const bool closed : {true, false}) {
            TriMesh mesh;
            mesh.points.emplace_back(0.f, 0.f, 1.f);
            for (int i = 0; i < n; ++i)
                mesh.points.emplace_back(float(std::cos(2 * M_PI * i / n)), float(std::sin(2 * M_PI * i / n)),
                                         0.f);
            for (int i = 0; i + !closed < n; ++i)
                mesh.triangles.push_back({0, VertexId(1 + i), VertexId(1 + (i + 1) % n)});
            const auto shuffle = [&] {
                std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), std::mt19937(9));
            };
            TriMesh split = mesh;
            shuffle();
            const auto flags = curvature_flags(mesh, "x");
            EXPECT_EQ(flags[0], closed ? 0 : curvature_border) << n;
            for (int i = 1; i <= n; ++i) EXPECT_EQ(flags[std::size_t(i)], curvature_border);
            if (n < 8) continue;
            mesh = split;  // in two fans
            mesh.triangles.erase(mesh.triangles.begin() + n / 2);
            mesh.triangles.erase(mesh.triangles.begin());
            shuffle();
            EXPECT_EQ(curvature_flags(mesh, "x")[0], curvature_border | curvature_undefined) << n;
        }
}

TEST(DiscreteCurvature, TheSameForAnyThreadsAndAnyOrderOfFaces) {
    const TriMesh mesh = bumpy(test::torus_mesh(25, 10, 400, 160), 0.02, 10);
    const auto with_threads = [&](const TriMesh& m, std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return discrete_curvature(m);
    };
    const DiscreteCurvature one = with_threads(mesh, 1), two = with_threads(mesh, 2);
    EXPECT_EQ(one.K, two.K);
    EXPECT_EQ(one.H, two.H);
    EXPECT_EQ(one.k2, two.k2);
    EXPECT_EQ(one.dual_area, two.dual_area);
    TriMesh shuffled = mesh;
    std::mt19937 random(11);
    std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random);
    for (Triangle& t : shuffled.triangles) std::rotate(t.begin(), t.begin() + random() % 3, t.end());
    const DiscreteCurvature other = with_threads(shuffled, 2);
    for (std::size_t v = 0; v < one.size(); ++v) {
        EXPECT_NEAR(other.K[v], one.K[v], 1e-11);
        EXPECT_NEAR(other.H[v], one.H[v], 1e-11);
    }
}

TEST(DiscreteCurvature, CanBeCancelled) {
    const Progress stop([](double) { return false; });
    EXPECT_THROW(discrete_curvature(test::icosphere(1, 1), {}, stop), Cancelled);
}

TEST(DiscreteCurvature, RealMeshes) {
    for (const char* name : {"pycurv_curvature/smooth_sphere_r10.surface.vtk",
                             "pycurv_curvature/smooth_torus_rr25_csr10.surface.vtk"}) {
        VDBGEO_NEEDS_DATA(name);
        const TriMesh mesh = read_mesh(test::data_folder() / name);
        const MeshMeasures m = measure_mesh(mesh);
        const double expected = 2 * M_PI * static_cast<double>(m.euler_characteristic);
        for (const DualArea kind : kinds) {
            const DiscreteCurvature c = discrete_curvature(mesh, {kind});
            EXPECT_NEAR(total_curvature(c), expected, 1e-9 * std::max(1.0, std::abs(expected))) << name;
            EXPECT_NEAR(total_area(c), m.area_A2, 1e-10 * m.area_A2);
        }
    }
}

}  // namespace
}  // namespace vdbgeo
