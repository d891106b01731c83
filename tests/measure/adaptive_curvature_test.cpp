#include "vdbgeo/measure/adaptive_curvature.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "converters/mesh_file.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "tests/support/small_meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/fit_surface.h"
#include "vdbgeo/measure/grid_shifts.h"
#include "vdbgeo/measure/sampling_lattice.h"
#include "vdbgeo/measure/wide_fits.h"
#include "vdbgeo/remesh/orient.h"
#include "vdbgeo/surface/marching_cubes.h"

namespace vdbgeo {
namespace {

using test::icosphere;

struct Principal {
    double k1, k2;
};
using Truth = std::function<Principal(const Vec3d&)>;

Truth sphere_truth(double r) {
    return [=](const Vec3d&) { return Principal{1 / r, 1 / r}; };
}

Truth torus_truth(const Vec3d& centre, double ring, double tube) {
    return [=](const Vec3d& p) {
        const Vec3d q = p - centre;
        const double out = std::hypot(q[0], q[1]) - ring, cosine = out / std::hypot(out, q[2]);
        return Principal{1 / tube, cosine / (ring + tube * cosine)};
    };
}

/// |Δκ|/|κ| at each vertex that is not on a border, ascending.
struct RelativeErrors {
    std::vector<double> k1, k2;

    RelativeErrors(const TriMesh& mesh, const Curvatures& c, const Truth& truth) {
        for (std::size_t v = 0; v < c.size(); ++v) {
            if (c.flags[v] & curvature_border) continue;
            const Principal t = truth(mesh.points[v].cast<double>());
            k1.push_back(std::abs(c.k1[v] - t.k1) / std::abs(t.k1));
            k2.push_back(std::abs(c.k2[v] - t.k2) / std::abs(t.k2));
        }
        for (auto* errors : {&k1, &k2}) {
            // NaN would hide in a sort.
            EXPECT_TRUE(std::none_of(errors->begin(), errors->end(), [](double e) { return std::isnan(e); }));
            std::sort(errors->begin(), errors->end());
        }
    }
};

void expect_percent(const std::vector<double>& errors, double median, double p95, const char* what) {
    ASSERT_FALSE(errors.empty());
    EXPECT_LE(100 * errors[errors.size() / 2], median) << what;
    EXPECT_LE(100 * errors[errors.size() * 95 / 100], p95) << what;
}

/// rms of r (H − H₀).
double mean_error(const TriMesh& mesh, const Curvatures& c, const Truth& truth, double r) {
    double sum = 0;
    for (std::size_t v = 0; v < c.size(); ++v) {
        const Principal t = truth(mesh.points[v].cast<double>());
        sum += std::pow(r * (c.H[v] - 0.5 * (t.k1 + t.k2)), 2);
    }
    return std::sqrt(sum / static_cast<double>(c.size()));
}

struct KErrors {
    double largest = 0, rms = 0;
};

KErrors gauss_errors(const TriMesh& mesh, const Curvatures& c, const Truth& truth, double within) {
    KErrors e;
    std::size_t n = 0;
    for (std::size_t v = 0; v < c.size(); ++v) {
        const Vec3d p = mesh.points[v].cast<double>();
        if (p.head<2>().cwiseAbs().maxCoeff() > within) continue;
        const Principal t = truth(p);
        const double off = std::abs(c.K[v] - t.k1 * t.k2);
        EXPECT_TRUE(std::isfinite(off));
        e.largest = std::max(e.largest, off);
        e.rms += off * off;
        ++n;
    }
    e.rms = std::sqrt(e.rms / static_cast<double>(n));
    return e;
}

/// Equilateral triangles of edge h over [−half, half]², taken to space by point(x, y).
template <class Point>
TriMesh hexagonal_patch(double h, double half, const Point& point) {
    TriMesh mesh;
    const double row = h * std::sqrt(3) / 2;
    const int columns = 2 * static_cast<int>(std::ceil(half / h)),
              rows = static_cast<int>(std::ceil(2 * half / row));
    for (int r = 0; r <= rows; ++r)
        for (int c = 0; c <= columns; ++c)
            mesh.points.push_back(
                Vec3d(point(-half + c * h + (r & 1 ? h / 2 : 0), -half + r * row)).template cast<float>());
    const auto id = [&](int r, int c) { return static_cast<VertexId>(r * (columns + 1) + c); };
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) {
            if (r & 1) {
                mesh.triangles.push_back({id(r, c), id(r, c + 1), id(r + 1, c + 1)});
                mesh.triangles.push_back({id(r, c), id(r + 1, c + 1), id(r + 1, c)});
            } else {
                mesh.triangles.push_back({id(r, c), id(r, c + 1), id(r + 1, c)});
                mesh.triangles.push_back({id(r, c + 1), id(r + 1, c + 1), id(r + 1, c)});
            }
        }
    return mesh;
}

/// Marching cubes of f, which is above 0 inside, from n³ samples a step h apart around the origin.
TriMesh cut_from_grid(int n, double h, const std::function<double(const Vec3d&)>& f) {
    return marching_cubes(test::map_from_function(Vec3i::Constant(n), test::centred_frame(n, h), f), {0.0});
}

TriMesh pycurv(const std::string& name) {
    TriMesh mesh = read_mesh(test::data_folder() / "pycurv_curvature" / (name + ".surface.vtk"));
    turn_outward(mesh);
    return mesh;
}

TEST(AdaptiveCurvature, SmoothSphereOfPyCurv) {
    VDBGEO_NEEDS_DATA("pycurv_curvature/smooth_sphere_r10.surface.vtk");
    for (const double r : {10.0, 20.0}) {
        const TriMesh mesh = pycurv(r == 10 ? "smooth_sphere_r10" : "smooth_sphere_r20");
        const RelativeErrors e(mesh, adaptive_curvature(mesh), sphere_truth(r));
        expect_percent(e.k1, 0.2, 0.5, "k1");
        expect_percent(e.k2, 0.2, 0.5, "k2");
    }
}

TEST(AdaptiveCurvature, SmoothTorusOfPyCurv) {
    VDBGEO_NEEDS_DATA("pycurv_curvature/smooth_torus_rr25_csr10.surface.vtk");
    const TriMesh mesh = pycurv("smooth_torus_rr25_csr10");
    const RelativeErrors e(mesh, adaptive_curvature(mesh), torus_truth(Vec3d::Zero(), 25, 10));
    expect_percent(e.k1, 0.2, 0.4, "k1");
    expect_percent(e.k2, 0.5, 5, "k2");
}

TEST(AdaptiveCurvature, VoxelLikeSpheresOfPyCurv) {
    VDBGEO_NEEDS_DATA("pycurv_curvature/noisy_sphere_r10.surface.vtk");
    TriMesh mesh = pycurv("noisy_sphere_r10");
    const RelativeErrors small(mesh, adaptive_curvature(mesh), sphere_truth(10));
    expect_percent(small.k1, 2, 5, "k1, radius 10");
    expect_percent(small.k2, 2, 5, "k2, radius 10");
    mesh = pycurv("noisy_sphere_r30");
    const RelativeErrors large(mesh, adaptive_curvature(mesh), sphere_truth(30));
    expect_percent(large.k1, 1, 2.5, "k1, radius 30");
    expect_percent(large.k2, 1, 2.5, "k2, radius 30");
}

TEST(AdaptiveCurvature, SmoothCylinderOfPyCurv) {
    VDBGEO_NEEDS_DATA("pycurv_curvature/smooth_cylinder_r10_h25.surface.vtk");
    const TriMesh mesh = test::flipped(
        read_mesh(test::data_folder() / "pycurv_curvature" / "smooth_cylinder_r10_h25.surface.vtk"));
    const Curvatures c = adaptive_curvature(mesh);
    for (std::size_t v = 0; v < c.size(); ++v) {
        EXPECT_NEAR(c.k1[v], 0.1, 0.005);
        EXPECT_NEAR(c.k2[v], 0, 0.002);
        EXPECT_GT(std::abs(c.direction2[v][2]), 0.99f);
    }
}

TEST(AdaptiveCurvature, SurfacesCutFromExactDistanceMaps) {
    // Off the nodes, steps that are no round numbers.
    const Vec3d centre(0.21, -0.13, 0.4);
    const TriMesh sphere = cut_from_grid(52, 1.37, [&](const Vec3d& p) { return 30 - (p - centre).norm(); });
    const AdaptiveCurvature c = adaptive_curvature(sphere);
    EXPECT_LT(mean_error(sphere, c, sphere_truth(30), 30), 5e-4);
    EXPECT_GT(c.radius, 2 * 1.37);
    const TriMesh torus = cut_from_grid(64, 1, [&](const Vec3d& p) {
        const Vec3d q = p - centre;
        return 9 - std::hypot(std::hypot(q[0], q[1]) - 19, q[2]);
    });
    EXPECT_LT(mean_error(torus, adaptive_curvature(torus), torus_truth(centre, 19, 9), 9), 4e-3);
}

TEST(AdaptiveCurvature, SagOfSteepMapsIsUndone) {
    // A density that falls to a third in 1.2 steps: its vertices are up to a tenth of a step off.
    const double radius = 12;
    const auto density = [&](const Vec3d& p) { return std::exp((radius - p.norm()) / 1.2) - 1; };
    const TriMesh mesh = cut_from_grid(34, 1, density);
    double off = 0;
    for (const Vec3f& p : mesh.points) off = std::max(off, p.cast<double>().norm() - radius);
    EXPECT_GT(off, 0.05);
    const RelativeErrors e(mesh, adaptive_curvature(mesh), sphere_truth(radius));
    expect_percent(e.k1, 0.2, 0.5, "k1");
    expect_percent(e.k2, 0.2, 0.5, "k2");
}

TEST(AdaptiveCurvature, NoiseWidensTheNeighbourhood) {
    double before = 0;
    for (const double noise : {0.0, 0.003, 0.03}) {
        std::mt19937 random(3);
        std::normal_distribution<double> jump;
        TriMesh mesh = icosphere(4, 1);
        for (Vec3f& p : mesh.points) p *= static_cast<float>(1 + noise * jump(random));
        const AdaptiveCurvature c = adaptive_curvature(mesh);
        EXPECT_GT(c.radius, before);
        before = c.radius;
        EXPECT_LT(mean_error(mesh, c, sphere_truth(1), 1), noise == 0 ? 1e-5 : noise) << noise;
    }
}

TEST(AdaptiveCurvature, ErrorOfKFallsAtSecondOrderOnExactMeshes) {
    const auto saddle = [](double x, double y) { return Vec3d(x, y, (x * x - y * y) / 2); };
    const Truth saddle_truth = [](const Vec3d& p) {
        const double x = p[0], y = -p[1], w = 1 + x * x + y * y, K = -1 / (w * w),
                     H = -((1 + y * y) - (1 + x * x)) / (2 * w * std::sqrt(w)), root = std::sqrt(H * H - K);
        return Principal{H + root, H - root};
    };
    const auto catenoid = [](double u, double v) {
        return Vec3d(std::cosh(v) * std::sin(u), v, std::cosh(v) * std::cos(u));
    };
    const Truth catenoid_truth = [](const Vec3d& p) {
        const double k = 1 / std::pow(std::cosh(p[1]), 2);
        return Principal{k, -k};
    };
    const auto torus = [](double u, double v) {
        const double out = 2 + std::cos(v);
        return Vec3d(out * std::sin(u / 2), std::sin(v), out * std::cos(u / 2));
    };
    const Truth torus_here = [](const Vec3d& p) {
        const double out = std::hypot(p[0], p[2]) - 2, cosine = out / std::hypot(out, p[1]);
        return Principal{1, cosine / (2 + cosine)};
    };
    const auto expect_order = [](const auto& point, const Truth& truth, const char* what) {
        KErrors e[3];
        for (int i = 0; i < 3; ++i) {
            const TriMesh mesh = hexagonal_patch(0.1 / (1 << i), 0.6, point);
            e[i] = gauss_errors(mesh, adaptive_curvature(mesh), truth, 0.35);
        }
        EXPECT_LT(e[0].largest, 8.3e-3) << what;
        EXPECT_LT(e[2].largest, 1e-3) << what;
        // Below this the rounding of coordinates, up to 3 here, to floats decides.
        const double rounding = 0x1p-22 / std::pow(0.1 / 4, 2);
        EXPECT_LT(e[2].largest, std::max(e[0].largest / std::pow(4, 1.9), rounding))
            << what << ": " << e[0].largest << " " << e[1].largest << " " << e[2].largest;
    };
    expect_order(saddle, saddle_truth, "saddle");
    expect_order(catenoid, catenoid_truth, "catenoid");
    expect_order(torus, torus_here, "torus");
}

TEST(AdaptiveCurvature, SpheresAreExactToTheRoundingOfCoordinates) {
    for (const double h : {0.1, 0.05, 0.025}) {
        const TriMesh mesh = hexagonal_patch(h, 0.5, [](double x, double y) {
            const double r = std::hypot(x, y), s = r > 0 ? std::sin(r) / r : 1;
            return Vec3d(x * s, y * s, std::cos(r));
        });
        EXPECT_LT(gauss_errors(mesh, adaptive_curvature(mesh), sphere_truth(1), 0.4).largest, 1e-4) << h;
    }
    const TriMesh pit = test::flipped(icosphere(3, 2));
    const Curvatures c = adaptive_curvature(pit);
    for (std::size_t v = 0; v < c.size(); ++v) EXPECT_NEAR(c.k2[v], -0.5, 1e-5);
}

TEST(AdaptiveCurvature, TheNodesOfAMaskAreInsideItsBoundary) {
    // At the value of the mask itself marching cubes leaves the outermost voxels' centres.
    const double radius = 12.3;
    const TriMesh nodes = marching_cubes(
        test::map_from_function(Vec3i::Constant(30), test::centred_frame(30, 1),
                                [&](const Vec3d& p) { return p.norm() <= radius ? 1.0 : 0.0; }),
        {1.0});
    EXPECT_LT(mean_error(nodes, adaptive_curvature(nodes), sphere_truth(radius), radius), 0.015);
    // Half way between the samples nothing is to be moved.
    const TriMesh between = marching_cubes(
        test::map_from_function(Vec3i::Constant(30), test::centred_frame(30, 1),
                                [&](const Vec3d& p) { return p.norm() <= radius ? 1.0 : 0.0; }),
        {0.5});
    EXPECT_LT(mean_error(between, adaptive_curvature(between), sphere_truth(radius), radius), 0.015);
}

TEST(AdaptiveCurvature, AnchorsStandForAFitAtEveryVertex) {
    // A mask with waves.
    const auto waves = [](const Vec3d& p) {
        const double r = p.norm(), flat = std::hypot(p[0], p[1]) / std::max(r, 1e-9);
        return r <= 18 + 2.5 * std::sin(3 * std::atan2(p[1], p[0])) * std::pow(flat, 3) ? 1.0 : 0.0;
    };
    const TriMesh mesh = marching_cubes(
        test::map_from_function(Vec3i::Constant(46), test::centred_frame(46, 1), waves), {0.5});
    const FitSurface surface(mesh);
    const ScaledFits fits(surface, mesh_spacing(surface, true));
    const FitScale scale{2, 0, 10, false};
    ASSERT_TRUE(is_wide(fits, scale));
    Curvatures out;
    out.flags = curvature_flags(mesh, "test");
    out.resize(mesh.points.size(), true);
    fit_by_anchors(fits, scale, out, {});
    PatchFit patch(surface);
    FittedCurvature k;
    double off = 0, size = 0, aside = 0;
    for (VertexId v = 0; v < out.size(); ++v) {
        ASSERT_TRUE(fits.fit(patch, v, scale, k));
        off += std::hypot(out.k1[v] - k.k1, out.k2[v] - k.k2);
        size += std::hypot(k.k1, k.k2);
        aside += (k.k1 - k.k2) * (1 - std::abs(k.direction1.dot(out.direction1[v].cast<double>())));
        EXPECT_NEAR(out.direction1[v].dot(out.direction2[v]), 0, 1e-5);
        EXPECT_NEAR(k.normal.dot(out.direction1[v].cast<double>()), 0, 0.1);
    }
    EXPECT_LT(off, 0.03 * size);
    EXPECT_LT(aside, 0.01 * size);
}

TEST(AdaptiveCurvature, BothSidesOfASheetKeepTheirOwnCurvature) {
    const double r = 20;
    const TriMesh sheet = cut_from_grid(48, 1, [&](const Vec3d& p) { return 1.5 - std::abs(p.norm() - r); });
    const Curvatures c = adaptive_curvature(sheet);
    for (std::size_t v = 0; v < c.size(); ++v) {
        const bool outside = sheet.points[v].norm() > r;
        EXPECT_NEAR(c.H[v], outside ? 1 / (r + 1.5) : -1 / (r - 1.5), 0.005);
    }
}

TEST(AdaptiveCurvature, BordersOfACylinder) {
    const TriMesh mesh = test::open_cylinder_mesh(2, 4);
    const AdaptiveCurvature c = adaptive_curvature(mesh);
    std::size_t borders = 0;
    for (std::size_t v = 0; v < c.size(); ++v) {
        borders += (c.flags[v] & curvature_border) != 0;
        EXPECT_NEAR(c.k1[v], 0.5, 0.01);
        EXPECT_NEAR(c.k2[v], 0, 0.01);
        EXPECT_GT(std::abs(c.direction2[v][2]), 0.99f);
    }
    EXPECT_EQ(borders, 2 * 96u);
}

TEST(AdaptiveCurvature, PiecesOfAFewFacesAreRound) {
    const float r = 0.05f;
    const TriMesh octahedron = test::mesh_of(
        {{r, 0, 0}, {-r, 0, 0}, {0, r, 0}, {0, -r, 0}, {0, 0, r}, {0, 0, -r}},
        {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}});
    const TriMesh mesh = test::joined(test::moved(icosphere(3, 1), Mat3d::Identity(), {3, 0, 0}), octahedron);
    const Curvatures c = adaptive_curvature(mesh);
    for (std::size_t v = mesh.points.size() - 6; v < mesh.points.size(); ++v) {
        EXPECT_NEAR(c.k1[v], 20, 1e-3);
        EXPECT_NEAR(c.k2[v], 20, 1e-3);
        EXPECT_NEAR(c.direction1[v].norm(), 1, 1e-5);
    }
    const Curvatures tetrahedron = adaptive_curvature(test::tetrahedron());
    for (std::size_t v = 0; v < 4; ++v) EXPECT_NEAR(tetrahedron.H[v], 2 / std::sqrt(3.0), 1e-5);
}

TEST(AdaptiveCurvature, DegenerateMeshes) {
    EXPECT_EQ(adaptive_curvature(TriMesh{}).size(), 0u);
    const Curvatures two = adaptive_curvature(
        test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0.5}}, {{0, 1, 2}, {1, 3, 2}}));
    EXPECT_EQ(two.size(), 4u);
    TriMesh mesh = icosphere(3, 1);
    mesh.triangles.push_back({0, 0, 11});  // names a vertex twice
    mesh.points.push_back({5, 5, 5});      // isolated
    const Curvatures c = adaptive_curvature(mesh);
    EXPECT_FALSE(c.defined(mesh.points.size() - 1));
    EXPECT_TRUE(std::isnan(c.K[mesh.points.size() - 1]));
    for (std::size_t v = 0; v + 1 < c.size(); ++v) EXPECT_NEAR(c.H[v], 1, 1e-4);
    // A flat sheet: exactly 0 in the middle of it.
    const Curvatures flat =
        adaptive_curvature(hexagonal_patch(0.1, 0.5, [](double x, double y) { return Vec3d(x, y, 0); }));
    for (std::size_t v = 0; v < flat.size(); ++v) {
        EXPECT_NEAR(flat.k1[v], 0, 1e-12);
        EXPECT_NEAR(flat.k2[v], 0, 1e-12);
    }
}

TEST(AdaptiveCurvature, ARadiusOfOnesOwn) {
    const TriMesh mesh = test::torus_mesh(3, 1);
    AdaptiveCurvatureOptions options;
    options.radius = 0.5;
    const AdaptiveCurvature c = adaptive_curvature(mesh, options);
    EXPECT_EQ(c.radius, 0.5);
    options.radius = 0.9;
    EXPECT_GT(mean_error(mesh, adaptive_curvature(mesh, options), torus_truth(Vec3d::Zero(), 3, 1), 1),
              mean_error(mesh, c, torus_truth(Vec3d::Zero(), 3, 1), 1));
    for (const double bad : {0.0, -1.0, std::numeric_limits<double>::infinity()}) {
        options.radius = bad;
        EXPECT_THROW(adaptive_curvature(mesh, options), InvalidInput);
    }
}

TEST(AdaptiveCurvature, SameBytesForAnyNumberOfThreads) {
    const TriMesh mesh = cut_from_grid(40, 1, [](const Vec3d& p) { return 15.2 - p.norm(); });
    const Curvatures two = adaptive_curvature(mesh);
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    const Curvatures one = adaptive_curvature(mesh);
    EXPECT_EQ(0, std::memcmp(one.k1.data(), two.k1.data(), one.size() * sizeof(double)));
    EXPECT_EQ(0, std::memcmp(one.K.data(), two.K.data(), one.size() * sizeof(double)));
    EXPECT_EQ(0, std::memcmp(one.direction2.data(), two.direction2.data(), one.size() * sizeof(Vec3f)));
}

TEST(GridShifts, TakeVerticesToTheSurface) {
    const Vec3d centre(0.3, -0.2, 0.1);
    const auto distance = [&](const Vec3d& p) { return (p - centre).norm() - 20; };
    // A distance, and a density as steep as ν = −½ a step makes it.
    for (const bool steep : {false, true}) {
        const TriMesh mesh = cut_from_grid(
            46, 1, [&](const Vec3d& p) { return steep ? std::exp(-0.5 * distance(p)) - 1 : -distance(p); });
        const auto lattice = find_sampling_lattice(mesh);
        ASSERT_TRUE(lattice);
        const FitSurface surface(mesh);
        const Array<Vec3f> shifts = interpolation_shifts(surface, *lattice);
        double before = 0, after = 0;
        for (std::size_t v = 0; v < shifts.size(); ++v) {
            const Vec3d p = mesh.points[v].cast<double>();
            before += std::pow(distance(p), 2);
            after += std::pow(distance(p + shifts[v].cast<double>()), 2);
        }
        EXPECT_LT(std::sqrt(after / before), steep ? 0.1 : 0.03);
    }
}

TEST(SamplingLattice, IsFoundWhereMarchingCubesLeftIt) {
    Frame frame = test::centred_frame(40, 1);
    frame.axes = Vec3d(1.31, 0.87, 2.02).asDiagonal();
    frame.origin = Vec3d(-31.4, 150, 7.7);
    const TriMesh mesh = marching_cubes(
        test::map_from_function(Vec3i(40, 60, 26), frame,
                                [](const Vec3d& p) { return 20.3 - (p - Vec3d(-6, 176, 33)).norm(); }),
        {0.0});
    const auto lattice = find_sampling_lattice(mesh);
    ASSERT_TRUE(lattice);
    for (int a = 0; a < 3; ++a) {
        EXPECT_NEAR(lattice->step[a], frame.axes(a, a), 1e-4);
        const double nodes = (lattice->origin[a] - frame.origin[a]) / lattice->step[a];
        EXPECT_NEAR(nodes, std::round(nodes), 1e-3);
    }
    Mat3d turn;
    turn = Eigen::AngleAxisd(0.3, Vec3d(1, 2, 3).normalized());
    EXPECT_FALSE(find_sampling_lattice(test::moved(mesh, turn)));
    EXPECT_FALSE(find_sampling_lattice(icosphere(4, 3)));
    EXPECT_FALSE(find_sampling_lattice(test::tetrahedron()));
}

}  // namespace
}  // namespace vdbgeo
