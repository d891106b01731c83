#include "vdbgeo/measure/field_curvature.h"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/support/meshes.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/measure/smoothed_view.h"
#include "vdbgeo/measure/triangle_tree.h"
#include "vdbgeo/remesh/isotropic_remesh.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/volume/phantom.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::map_from_function;
using Field = std::function<double(const Vec3d&)>;

FieldCurvatureOptions at_scale(double scale, bool level_set = false) {
    FieldCurvatureOptions options;
    options.scale = scale;
    options.level_set = level_set;
    return options;
}

TriMesh surface_of(const DensityMap& map, double isovalue = 0) {
    MarchingCubesOptions options;
    options.isovalue = isovalue;
    return marching_cubes(map, options);
}

struct Truth {
    double K, H;
};

/// From differences of the field in double precision, dense inside.
Truth level_set_curvature(const Field& f, const Vec3d& p, double step) {
    Vec3d g;
    Mat3d q;
    for (int a = 0; a < 3; ++a) {
        const Vec3d da = step * Vec3d::Unit(a);
        g[a] = (f(p + da) - f(p - da)) / (2 * step);
        for (int b = 0; b < 3; ++b) {
            const Vec3d db = step * Vec3d::Unit(b);
            q(a, b) = (f(p + da + db) - f(p + da - db) - f(p - da + db) + f(p - da - db)) / (4 * step * step);
        }
    }
    const Vec3d n = -g.normalized();
    const Mat3d project = Mat3d::Identity() - n * n.transpose();
    const Mat3d shape = -project * q * project / g.norm();
    const double trace = shape.trace();
    return {0.5 * (trace * trace - (shape * shape).trace()), 0.5 * trace};
}

struct Error {
    double K = 0, H = 0;
    std::size_t undefined = 0;
};

/// The largest over the vertices of marching cubes in a box of n³ samples of h.
Error largest_error(const Field& f, int n, double h, double scale, double inner) {
    Frame frame = centred_frame(n, h);
    frame.origin += h * Vec3d(0.13, 0.29, 0.41);
    const DensityMap map = map_from_function(Vec3i::Constant(n), frame, f);
    const TriMesh mesh = surface_of(map);
    const FieldCurvature found = field_curvature(mesh, map, at_scale(scale));
    Error error;
    for (std::size_t v = 0; v < found.size(); ++v) {
        const Vec3d p = mesh.points[v].cast<double>();
        if (p.cwiseAbs().maxCoeff() > inner) continue;
        if (!found.defined(v)) {
            ++error.undefined;
            continue;
        }
        const Truth truth = level_set_curvature(f, p, 1e-3);
        error.K = std::max(error.K, std::abs(found.K[v] - truth.K));
        error.H = std::max(error.H, std::abs(found.H[v] - truth.H));
    }
    return error;
}

/// Values as bytes: NaN equals itself.
bool same_bits(const Curvatures& a, const Curvatures& b) {
    const auto same = [](const auto& x, const auto& y) {
        return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0;
    };
    return same(a.K, b.K) && same(a.H, b.H) && same(a.k1, b.k1) && same(a.k2, b.k2) &&
           same(a.flags, b.flags) && same(a.direction1, b.direction1) && same(a.direction2, b.direction2);
}

Field sphere(double r) {
    return [r](const Vec3d& p) { return sphere_field(p, r); };
}

/// Random quadratics whose samples are 32-bit floats without rounding.
TEST(SmoothedView, QuadraticsAreDifferentiatedExactlyEverywhere) {
    std::mt19937 random(7);
    std::uniform_int_distribution<int> eighths(-16, 16);
    const Vec3i size(37, 30, 41);
    for (const Vec3d& sigma : {Vec3d(0.5, 0.5, 0.5), Vec3d(0.7, 1, 1.5), Vec3d(1, 1, 1), Vec3d(1.5, 2, 2),
                               Vec3d(2.5, 3, 4), Vec3d(6, 0.8, 6)}) {
        Mat3d q;
        Vec3d g;
        for (int a = 0; a < 3; ++a) {
            g[a] = eighths(random) / 8.0;
            for (int b = 0; b <= a; ++b) q(a, b) = q(b, a) = eighths(random) / 8.0;
        }
        const DensityMap map =
            map_from_function(size, {}, [&](const Vec3d& p) { return 3 + g.dot(p) + 0.5 * p.dot(q * p); });
        SmoothedView view(map, sigma);
        const int edge = SmoothedView::edge_for(sigma);
        std::uniform_real_distribution<double> uniform(0, 1);
        for (int i = 0; i < 12; ++i) {
            Vec3d at;
            for (int a = 0; a < 3; ++a) at[a] = uniform(random) * (size[a] - 1);
            if (i == 0) at = Vec3d(0, 0, 0);  // where the window is cut in half along every axis
            if (i == 1) at = (size - Vec3i::Ones()).cast<double>();
            openvdb::Coord corner;
            for (int a = 0; a < 3; ++a) corner[a] = static_cast<int>(at[a]) / edge * edge;
            view.move_to(corner);
            ASSERT_TRUE(view.holds(at));
            Derivatives d;
            ASSERT_TRUE(view.derivatives(at, d));
            const double smooth = 0.5 * q.diagonal().dot(sigma.cwiseAbs2());
            EXPECT_NEAR(d.value, 3 + g.dot(at) + 0.5 * at.dot(q * at) + smooth, 3e-8);
            EXPECT_LT((d.gradient - g - q * at).norm(), 3e-8)
                << sigma.transpose() << " at " << at.transpose();
            EXPECT_LT((d.hessian - q).norm(), 3e-8) << sigma.transpose() << " at " << at.transpose();
        }
    }
}

TEST(FieldCurvature, ErrorsFallWithTheSquareOfTheVoxel) {
    struct Case {
        const char* name;
        Field field;
        double inner;
    };
    const Case cases[] = {
        {"torus", [](const Vec3d& p) { return torus_field(p, 2, 0.8); }, 3},
        {"saddle", [](const Vec3d& p) { return saddle_field(p, 1.5); }, 2},
        {"catenoid", [](const Vec3d& p) { return catenoid_field(p, 1.2); }, 2},
        // A gaussian changes waves of one length by a factor alone; the bowl makes that a change of shape.
        {"gyroid in a bowl", [](const Vec3d& p) { return gyroid_field(p, 6) - 0.1 * p.squaredNorm(); }, 2},
    };
    for (const Case& c : cases) {
        const Error coarse = largest_error(c.field, 49, 0.125, 1.5, c.inner);
        const Error fine = largest_error(c.field, 97, 0.0625, 1.5, c.inner);
        EXPECT_EQ(coarse.undefined + fine.undefined, 0u) << c.name;
        EXPECT_GT(std::log2(coarse.K / fine.K), 1.9) << c.name << ": " << coarse.K << ", " << fine.K;
        EXPECT_GT(std::log2(coarse.H / fine.H), 1.9) << c.name << ": " << coarse.H << ", " << fine.H;
    }
}

/// A gaussian leaves spheres spheres, so what is left are the samples' own rounding and the limit.
TEST(FieldCurvature, SpheresKeepTheirCurvatureAtAnyScale) {
    for (const double scale : {0.7, 1.0, 1.5, 2.0, 2.5, 4.0}) {
        const Error error = largest_error(sphere(2), 65, 0.0625 * 1.25, scale, 3);
        const double limit = std::pow(scale * 0.0625 * 1.25 / 2, 4) / 4;
        EXPECT_LT(error.H, 0.5 * (2e-3 + 2 * limit)) << scale;
        EXPECT_EQ(error.undefined, 0u);
    }
}

TEST(FieldCurvature, SignIsThatOfTheSolid) {
    const Frame frame = centred_frame(40, 1);
    const DensityMap ball = map_from_function({40, 40, 40}, frame, sphere(12));
    const DensityMap level_set =
        map_from_function({40, 40, 40}, frame, [](const Vec3d& p) { return p.norm() - 12; });
    const TriMesh mesh = surface_of(ball);
    const FieldCurvature dense = field_curvature(mesh, ball, at_scale(1.5));
    const FieldCurvature outward = field_curvature(mesh, level_set, at_scale(1.5, true));
    EXPECT_EQ(dense.k1, outward.k1);
    EXPECT_EQ(dense.k2, outward.k2);
    EXPECT_EQ(dense.K, outward.K);
    EXPECT_EQ(dense.H, outward.H);
    const FieldCurvature pit = field_curvature(mesh, level_set, at_scale(1.5));
    for (std::size_t v = 0; v < dense.size(); ++v) {
        EXPECT_NEAR(dense.k1[v], 1.0 / 12, 1e-3);
        EXPECT_NEAR(dense.k2[v], 1.0 / 12, 1e-3);
        EXPECT_EQ(pit.k1[v], -dense.k2[v]);
        EXPECT_EQ(pit.H[v], -dense.H[v]);
        EXPECT_EQ(pit.K[v], dense.K[v]);
    }
}

/// Level sets of a quadratic are known in any frame, and its derivatives are exact.
TEST(FieldCurvature, AnisotropicAndShearedFrames) {
    Mat3d q;
    q << 1.0, 0.2, -0.1, 0.2, 0.7, 0.15, -0.1, 0.15, 1.3;
    const Field f = [&](const Vec3d& p) { return 1 - p.dot(q * p) / 900; };
    Frame stretched, sheared;
    stretched.axes = Vec3d(0.8, 1.1, 2.4).asDiagonal();
    sheared.axes << 1.0, 0.35, -0.3, 0.05, 1.2, 0.4, 0, -0.1, 0.9;
    for (Frame* frame : {&stretched, &sheared}) {
        const Vec3i size(112, 112, 112);
        frame->origin = -frame->axes * Vec3d(55.3, 55.6, 55.4);
        const DensityMap map = map_from_function(size, *frame, f);
        TriMesh mesh = test::icosphere(3, 1);
        for (Vec3f& p : mesh.points) {
            const Vec3d d = p.cast<double>();
            p = (d * 30 / std::sqrt(d.dot(q * d))).cast<float>();
        }
        const FieldCurvature found = field_curvature(mesh, map, at_scale(1));
        for (std::size_t v = 0; v < found.size(); ++v) {
            ASSERT_TRUE(found.defined(v));
            const Truth truth = level_set_curvature(f, mesh.points[v].cast<double>(), 0.5);
            EXPECT_NEAR(found.H[v], truth.H, 1e-3 * truth.H);
            EXPECT_NEAR(found.K[v], truth.K, 2e-3 * truth.K);
        }
    }
}

TEST(FieldCurvature, DirectionsOfATorus) {
    const double ring = 20, tube = 8;
    const DensityMap map = map_from_function(
        {72, 72, 32},
        [] {
            Frame frame = centred_frame(72, 1);
            frame.origin.z() = -15.4;
            return frame;
        }(),
        [&](const Vec3d& p) { return torus_field(p, ring, tube); });
    const TriMesh mesh = test::torus_mesh(ring, tube);
    const FieldCurvature found = field_curvature(mesh, map, at_scale(1));
    ASSERT_TRUE(found.has_directions());
    for (std::size_t v = 0; v < found.size(); ++v) {
        const Vec3d p = mesh.points[v].cast<double>();
        const Vec3d around = Vec3d(-p.y(), p.x(), 0).normalized();
        const Vec3d d1 = found.direction1[v].cast<double>(), d2 = found.direction2[v].cast<double>();
        EXPECT_NEAR(d1.norm(), 1, 1e-6);
        EXPECT_NEAR(d1.dot(d2), 0, 1e-6);
        EXPECT_GT(std::abs(d2.dot(around)), 0.999);                 // the tube's is the larger curvature
        EXPECT_GT(d1.maxCoeff(), 0.99 * d1.cwiseAbs().maxCoeff());  // with_stable_sign, but for ties
        EXPECT_NEAR(found.k1[v], 1 / tube, 0.03 / tube);
    }
}

/// A surface that has no symmetry, over points that are eighths.
struct Bumpy {
    TriMesh mesh = test::icosphere(3, 10);
    Field field = [](const Vec3d& p) {
        return 12 + 0.02 * p.x() * p.y() - p.norm() + std::sin(0.4 * p.x() + 0.7) + std::cos(0.5 * p.z());
    };
    Bumpy() {
        for (Vec3f& p : mesh.points) p = (8 * p).array().round().matrix() / 8;
    }
};

TEST(FieldCurvature, WholeVoxelsOfShiftChangeNothing) {
    const Bumpy bumpy;
    const Vec3i n(56, 56, 56), shift(3, -5, 7);
    for (const double scale : {1.0, 1.5}) {
        Frame frame;
        frame.origin = Vec3d::Constant(-28);
        const DensityMap map = map_from_function(n, frame, bumpy.field);
        Frame moved_frame;
        moved_frame.origin = frame.origin + shift.cast<double>();
        const DensityMap moved = map_from_function(n, moved_frame, bumpy.field);
        EXPECT_TRUE(same_bits(field_curvature(bumpy.mesh, map, at_scale(scale)),
                              field_curvature(bumpy.mesh, moved, at_scale(scale))));
    }
}

TEST(FieldCurvature, TurnsWithTheMap) {
    const Bumpy bumpy;
    Mat3d turn;
    turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    const Frame frame = centred_frame(43, 1);
    const DensityMap map = map_from_function({43, 43, 43}, frame, bumpy.field);
    const DensityMap turned = map_from_function(
        {43, 43, 43}, frame, [&](const Vec3d& p) { return bumpy.field(turn.transpose() * p); });
    TriMesh mesh = bumpy.mesh;
    for (Vec3f& p : mesh.points) p = (turn * p.cast<double>()).cast<float>();
    for (const double scale : {1.0, 3.0}) {
        const FieldCurvature a = field_curvature(bumpy.mesh, map, at_scale(scale));
        const FieldCurvature b = field_curvature(mesh, turned, at_scale(scale));
        for (std::size_t v = 0; v < a.size(); ++v) {
            EXPECT_NEAR(a.k1[v], b.k1[v], 1e-11);
            EXPECT_NEAR(a.k2[v], b.k2[v], 1e-11);
            if (a.k1[v] - a.k2[v] > 1e-3) {
                const double along =
                    (turn * a.direction1[v].cast<double>()).dot(b.direction1[v].cast<double>());
                EXPECT_NEAR(std::abs(along), 1, 1e-5);
            }
        }
    }
}

/// A paraboloid that leaves the box through its sides: one-sided windows, exact all the same.
TEST(FieldCurvature, AtTheBorderOfTheBox) {
    const Field f = [](const Vec3d& p) { return 12.25 - p.z() - p.x() * p.x() / 64; };
    const DensityMap map = map_from_function({24, 20, 24}, {}, f);
    const TriMesh mesh =
        test::ring_mesh(24, 20, false, [&](int x, int y) { return Vec3d(x, y, 12.25 - x * x / 64.0); });
    for (const double scale : {1.0, 1.5}) {
        const FieldCurvature found = field_curvature(mesh, map, at_scale(scale));
        for (std::size_t v = 0; v < found.size(); ++v) {
            const double x = static_cast<double>(mesh.points[v].x());
            const double k = (1 / 32.0) / std::pow(1 + x * x / 1024, 1.5);
            EXPECT_NEAR(found.k1[v], k, 1e-3 * k);
            EXPECT_NEAR(found.k2[v], 0, 1e-9);
        }
    }
}

TEST(FieldCurvature, UndefinedWhereTheMapTellsNothing) {
    const Frame frame = centred_frame(48, 1);
    const TriMesh mesh = test::icosphere(3, 14);
    const DensityMap good = map_from_function({48, 48, 48}, frame, sphere(14));
    const FieldCurvature all = field_curvature(mesh, good, at_scale(1));
    const Vec3d hole = frame.to_world({10, 24, 24});
    const DensityMap bad = map_from_function({48, 48, 48}, frame, [&](const Vec3d& p) {
        return (p - hole).norm() < 0.1 ? std::numeric_limits<double>::quiet_NaN() : 14 - p.norm();
    });
    const FieldCurvature found = field_curvature(mesh, bad, at_scale(1));
    std::size_t undefined = 0;
    for (std::size_t v = 0; v < found.size(); ++v) {
        const double away = (mesh.points[v].cast<double>() - hole).cwiseAbs().maxCoeff();
        undefined += !found.defined(v);
        EXPECT_EQ(found.defined(v), std::isfinite(found.K[v]));
        if (away < 3) {
            EXPECT_FALSE(found.defined(v));
        } else if (away > 5) {
            EXPECT_EQ(found.K[v], all.K[v]);
        }
    }
    EXPECT_GT(undefined, 0u);
    EXPECT_LT(undefined, found.size() / 2);

    const DensityMap flat = map_from_function({48, 48, 48}, frame, [](const Vec3d&) { return 3.7; });
    const DensityMap small = map_from_function({12, 12, 12}, centred_frame(12, 1), sphere(14));
    const DensityMap thin = map_from_function({48, 48, 2}, frame, sphere(14));
    for (const DensityMap* map : {&flat, &small, &thin}) {
        const FieldCurvature none = field_curvature(mesh, *map);
        for (std::size_t v = 0; v < none.size(); ++v) EXPECT_FALSE(none.defined(v));
    }
    TriMesh capped = mesh;
    capped.face_properties.push_back({cap_property, 1, std::vector<float>(mesh.triangles.size(), 1.0f)});
    const FieldCurvature caps = field_curvature(capped, good, at_scale(1));
    EXPECT_EQ(caps.flags[0], curvature_cap | curvature_undefined);
}

TEST(FieldCurvature, SparseIsDenseWhereTheWindowIsActive) {
    const Frame frame = centred_frame(60, 1);
    const DensityMap dense = map_from_function({60, 60, 60}, frame, sphere(17.3));
    DensityMap sparse = dense;
    sparse.grid = openvdb::FloatGrid::create(-9);
    auto to = sparse.grid->getAccessor();
    for (auto it = dense.grid->cbeginValueOn(); it; ++it)
        if (std::abs(*it) < 12) to.setValueOn(it.getCoord(), *it);
    DensityMap unbounded = sparse;
    unbounded.frame.size.setZero();
    const TriMesh mesh = surface_of(dense);
    const FieldCurvature expected = field_curvature(mesh, dense, at_scale(1.5));
    EXPECT_TRUE(same_bits(expected, field_curvature(mesh, sparse, at_scale(1.5))));
    EXPECT_TRUE(same_bits(expected, field_curvature(mesh, unbounded, at_scale(1.5))));
}

DensityMap noisy_phantom(double snr, int size) {
    PhantomOptions options;
    options.kind = "atpase";
    options.size = size;
    options.snr = snr;
    options.seed = 5;
    const Phantom phantom(options);
    std::vector<float> values(std::size_t(size) * std::size_t(size) * std::size_t(size));
    phantom.sections(0, size, values.data());
    return test::map_from_values(Vec3i::Constant(size), values, phantom.frame());
}

TEST(FieldCurvature, SameBytesForAnyNumberOfThreads) {
    const DensityMap map = noisy_phantom(5, 48);
    const TriMesh mesh = surface_of(map, 0.5);
    for (const std::optional<double> scale : {std::optional<double>(), std::optional<double>(3.0)}) {
        FieldCurvatureOptions options;
        options.scale = scale;
        FieldCurvature one, two;
        test::with_threads(1, [&] { one = field_curvature(mesh, map, options); });
        test::with_threads(2, [&] { two = field_curvature(mesh, map, options); });
        EXPECT_TRUE(same_bits(one, two));
        EXPECT_EQ(one.scale, two.scale);
    }
}

/// The value at the nearest point of a mesh, between its vertices.
double interpolated(const TriMesh& mesh, const Array<double>& values, const TriangleTree& tree,
                    const Vec3d& p) {
    const TriangleTree::Nearest near = tree.nearest(p);
    const Triangle& t = mesh.triangles[near.face];
    const Vec3d a = mesh.points[t[0]].cast<double>(), b = mesh.points[t[1]].cast<double>(),
                c = mesh.points[t[2]].cast<double>();
    const Vec3d n = (b - a).cross(c - a);
    const double wb = n.dot((near.point - a).cross(c - a)) / n.squaredNorm(),
                 wc = n.dot((b - a).cross(near.point - a)) / n.squaredNorm();
    return (1 - wb - wc) * values[t[0]] + wb * values[t[1]] + wc * values[t[2]];
}

TEST(FieldCurvature, OfANoisyMapIsThatOfItsRemeshedSurface) {
    const DensityMap map = noisy_phantom(8, 64);
    const TriMesh mesh = surface_of(map, 0.5);
    const TriMesh remeshed = isotropic_remesh(mesh);
    const FieldCurvature a = field_curvature(mesh, map, at_scale(2));
    const FieldCurvature b = field_curvature(remeshed, map, at_scale(2));
    const TriangleTree tree(mesh);
    double n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
    for (std::size_t v = 0; v < b.size(); ++v) {
        const double x = interpolated(mesh, a.k2, tree, remeshed.points[v].cast<double>()), y = b.k2[v];
        if (!std::isfinite(x) || !std::isfinite(y)) continue;
        n += 1;
        sx += x, sy += y, sxx += x * x, syy += y * y, sxy += x * y;
    }
    EXPECT_GT(n, 0.99 * static_cast<double>(b.size()));
    const double correlation = (sxy - sx * sy / n) / std::sqrt((sxx - sx * sx / n) * (syy - sy * sy / n));
    EXPECT_GT(correlation, 0.98) << "at scale " << a.scale;
}

TEST(FieldCurvature, ChoosesItsScaleFromTheMap) {
    const Frame frame = centred_frame(48, 1);
    const TriMesh mesh = test::icosphere(3, 14);
    const auto chosen = [&](const Field& f) {
        return field_curvature(mesh, map_from_function({48, 48, 48}, frame, f)).scale;
    };
    EXPECT_EQ(chosen(sphere(14)), 1);
    EXPECT_EQ(chosen([](const Vec3d& p) { return 1 / (1 + std::exp(p.norm() - 14)); }), 1);
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 0.6);
    EXPECT_GT(chosen([&](const Vec3d& p) { return 14 - p.norm() + noise(random); }), 1);
    EXPECT_EQ(chosen([](const Vec3d& p) { return p.norm() < 14 ? 1.0 : 0.0; }), 5);
}

/// The bars that voxel-like spheres are held to elsewhere: 2 and 5 % at radius 10.
TEST(FieldCurvature, OfAMask) {
    const double r = 10;
    Frame frame = centred_frame(50, 1);
    frame.origin += Vec3d(0.13, 0.21, 0.37);
    const DensityMap map = map_from_function(Vec3i::Constant(50), frame,
                                             [&](const Vec3d& p) { return p.norm() <= r ? 1.0 : 0.0; });
    const FieldCurvature found = field_curvature(surface_of(map, 0.5), map);
    for (const Array<double>* k : {&found.k1, &found.k2}) {
        std::vector<double> errors;
        for (const double value : *k) errors.push_back(std::abs(r * value - 1));
        std::sort(errors.begin(), errors.end());
        EXPECT_LT(errors[errors.size() / 2], 0.02);
        EXPECT_LT(errors[errors.size() * 95 / 100], 0.05);
    }
}

TEST(FieldCurvature, RefusesBadScalesTakesAnEmptyMeshAndStops) {
    const DensityMap map = map_from_function({8, 8, 8}, centred_frame(8, 1), sphere(3));
    for (const double bad : {0.0, 0.49, 12.5, -1.0, std::nan("")})
        EXPECT_THROW(field_curvature(test::icosphere(1, 3), map, at_scale(bad)), InvalidInput) << bad;
    EXPECT_EQ(field_curvature({}, map).size(), 0u);
    const Progress stop([](double) { return false; });
    EXPECT_THROW(field_curvature(test::icosphere(1, 3), map, {}, stop), Cancelled);
}

}  // namespace
}  // namespace vdbgeo
