#include "vdbgeo/tet/isosurface_stuffing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <set>

#include "converters/mrc.h"
#include "tests/support/data.h"
#include "tests/support/grids.h"
#include "tests/support/maps.h"
#include "tests/tet/dihedrals.h"
#include "tests/tet/stuffing_oracle.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/tet_adjacency.h"
#include "vdbgeo/measure/mesh_measures.h"
#include "vdbgeo/surface/marching_cubes.h"
#include "vdbgeo/surface/trilinear_field.h"
#include "vdbgeo/tet/stuffing_snap.h"
#include "vdbgeo/volume/phantom.h"

namespace vdbgeo {
namespace {

using test::centred_frame;
using test::dihedrals;
using test::map_from_function;
using test::map_from_values;

class IsosurfaceStuffing : public testing::Test {
 protected:
    void SetUp() override { openvdb::initialize(); }
};

StuffingOptions with(double cell, int coarsening) {
    StuffingOptions options;
    options.cell = cell;
    options.coarsening = coarsening;
    return options;
}

std::array<Vec3d, 4> corners(const TetMesh& mesh, std::size_t t) {
    std::array<Vec3d, 4> p;
    for (std::size_t k = 0; k < 4; ++k) p[k] = mesh.points[mesh.tets[t][k]];
    return p;
}

std::pair<double, double> angle_range(const TetMesh& mesh) {
    double least = 180, largest = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        for (const double a : dihedrals(corners(mesh, t)))
            least = std::min(least, a), largest = std::max(largest, a);
    return {least, largest};
}

double volume(const TetMesh& mesh) {
    double sum = 0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) sum += tet_determinant(mesh, t);
    return sum / 6;
}

using Edge = std::pair<VertexId, VertexId>;

/// Edges that the boundary's triangles do not run through as often one way as the other.
std::size_t open_edges(const TetMesh& mesh) {
    std::vector<std::pair<Edge, int>> uses;
    for (const Triangle& f : mesh.faces)
        for (std::size_t k = 0; k < 3; ++k) {
            const VertexId a = f[k], b = f[(k + 1) % 3];
            uses.push_back({std::minmax(a, b), a < b ? 1 : -1});
        }
    std::sort(uses.begin(), uses.end());
    std::size_t open = 0;
    for (std::size_t k = 0, next = 0; k < uses.size(); k = next) {
        int sum = 0;
        for (next = k; next < uses.size() && uses[next].first == uses[k].first; ++next)
            sum += uses[next].second;
        open += sum != 0;
    }
    return open;
}

/// V − E + F − T.
std::int64_t euler(const TetMesh& mesh) {
    std::vector<Edge> edges;
    for (const Tetrahedron& t : mesh.tets)
        for (const auto& e : tet_edges)
            edges.push_back(
                std::minmax(t[static_cast<std::size_t>(e[0])], t[static_cast<std::size_t>(e[1])]));
    std::sort(edges.begin(), edges.end());
    const auto different = std::unique(edges.begin(), edges.end()) - edges.begin();
    const auto tets = static_cast<std::int64_t>(mesh.tets.size()),
               outer = static_cast<std::int64_t>(mesh.faces.size());
    return static_cast<std::int64_t>(mesh.points.size()) - different + (4 * tets + outer) / 2 - tets;
}

/// What every result promises: conforming, positive, no vertex unused, angles in the bounds, faces as
/// set_faces gives them, closed.
void expect_sound(const TetMesh& mesh) {
    check(mesh, "stuffing");
    ASSERT_FALSE(mesh.empty());
    const auto [least, largest] = angle_range(mesh);
    EXPECT_GE(least, 10.7);
    EXPECT_LE(largest, 164.8);
    TetMesh again = mesh;
    set_faces(again);  // throws where the mesh is not conforming
    EXPECT_EQ(again.faces, mesh.faces);
    EXPECT_EQ(again.face_regions, mesh.face_regions);
    EXPECT_EQ(open_edges(mesh), 0u);
    std::vector<bool> used(mesh.points.size(), false);
    for (const Tetrahedron& t : mesh.tets)
        for (const VertexId v : t) used[v] = true;
    EXPECT_TRUE(std::all_of(used.begin(), used.end(), [](bool u) { return u; }));
}

/// Vertices of the boundary lie on the surface, those inside the mesh are inside.
void expect_on_surface(const TetMesh& mesh, const DensityMap& map, double isovalue, double tolerance) {
    const TrilinearField field(map, isovalue);
    const Mat3d to_index = map.frame.axes.inverse();
    std::vector<bool> outer(mesh.points.size(), false);
    for (const Triangle& f : mesh.faces)
        for (const VertexId v : f) outer[v] = true;
    double worst = 0;
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const Vec3d index = to_index * (mesh.points[v] - map.frame.origin);
        if (outer[v])
            worst = std::max(worst, std::abs(field(index)));
        else
            ASSERT_GE(field(index), -tolerance) << "vertex " << v;
    }
    EXPECT_LE(worst, tolerance);
}

DensityMap sphere_map(int n, double radius, const Vec3d& centre = Vec3d::Zero()) {
    return map_from_function(Vec3i::Constant(n), centred_frame(n, 1),
                             [&](const Vec3d& p) { return radius - (p - centre).norm(); });
}

DensityMap phantom_map(const std::string& kind, int size, std::optional<double> snr = {}) {
    PhantomOptions options;
    options.kind = kind;
    options.size = size;
    options.snr = snr;
    const Phantom phantom(options);
    std::vector<float> values(static_cast<std::size_t>(size) * static_cast<std::size_t>(size) *
                              static_cast<std::size_t>(size));
    phantom.sections(0, size, values.data());
    return map_from_values(Vec3i::Constant(size), values, phantom.frame());
}

double marching_cubes_volume(const DensityMap& map, double isovalue) {
    return *measure_mesh(marching_cubes(map, {isovalue})).volume_A3;
}

// --- Against the plain algorithm --------------------------------------------------------------------------

using Shape = std::set<std::array<std::array<std::int64_t, 3>, 4>>;

std::array<std::int64_t, 3> rounded(const Vec3d& p) {
    return {std::llround(p.x() * 1e6), std::llround(p.y() * 1e6), std::llround(p.z() * 1e6)};
}

Shape shape_of(const TetMesh& mesh, const Vec3d& origin, double cell) {
    Shape out;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        std::array<std::array<std::int64_t, 3>, 4> tet;
        const auto p = corners(mesh, t);
        for (std::size_t k = 0; k < 4; ++k) tet[k] = rounded((p[k] - origin) / cell);
        std::sort(tet.begin(), tet.end());
        out.insert(tet);
    }
    return out;
}

/// `same_roots`: with the library's root finder, where edges are crossed more than once.
void expect_as_oracle(const DensityMap& map, double isovalue, double cell, int low, int high,
                      bool same_roots) {
    const double h = map.frame.axes(0, 0);
    const TetMesh mesh = isosurface_stuffing(map, isovalue, with(cell, 0));
    expect_sound(mesh);
    const TrilinearField field(map, isovalue);
    const stuffing::Lattice lattice(map, isovalue, cell);
    test::StuffingOracle::Root root;
    if (same_roots) root = [&](const Vec3d& in, const Vec3d& out) { return lattice.root(in, out); };
    const test::StuffingOracle oracle([&](const Vec3d& p) { return field(cell * p); }, root, low, high,
                                      stuffing::alpha_long, stuffing::alpha_short);
    Shape expected;
    for (const auto& t : oracle.tets()) {
        std::array<std::array<std::int64_t, 3>, 4> tet;
        for (std::size_t k = 0; k < 4; ++k) tet[k] = rounded(oracle.position(t[k]));
        std::sort(tet.begin(), tet.end());
        expected.insert(tet);
    }
    ASSERT_EQ(mesh.tets.size(), oracle.tets().size());
    const Shape found = shape_of(mesh, map.frame.origin, cell * h);
    std::size_t missing = 0;
    for (const auto& t : found) missing += expected.count(t) == 0;
    // Roots may differ by 1e-10: a few places are then rounded the other way.
    EXPECT_LE(missing, same_roots ? 0 : found.size() / 200);
}

TEST_F(IsosurfaceStuffing, IsThePlainAlgorithm) {
    expect_as_oracle(sphere_map(24, 7.3, Vec3d(0.3, -0.2, 0.4)), 0, 1.3, -2, 20, false);
    Frame frame;
    frame.axes *= 2.5;
    frame.origin = Vec3d(-3, 7, 11);
    for (const std::uint64_t seed : {3, 4, 5}) {
        const int n = 12;
        std::vector<float> values = test::noise(static_cast<std::size_t>(n * n * n), seed);
        // Away from the border: along its edges many cut points are equally near.
        for (int k = 0; k < n * n * n; ++k)
            for (const int i : {k % n, k / n % n, k / n / n})
                if (i == 0 || i == n - 1) values[static_cast<std::size_t>(k)] = -1;
        expect_as_oracle(map_from_values(Vec3i::Constant(n), values, frame), 0.3,
                         0.6 + 0.3 * static_cast<double>(seed - 3), -2, 22, true);
    }
}

// --- Shapes -----------------------------------------------------------------------------------------------

TEST_F(IsosurfaceStuffing, SphereIsSoundAtAnyCell) {
    const DensityMap map = sphere_map(40, 14, Vec3d(0.1, 0.2, -0.3));
    for (const double cell : {0.5, 0.75, 1.0, 1.7, 3.0, 5.0}) {
        const TetMesh mesh = isosurface_stuffing(map, 0, with(cell, 3));
        expect_sound(mesh);
        expect_on_surface(mesh, map, 0, 1e-8);
        EXPECT_EQ(euler(mesh), 1) << cell;
        const MeshMeasures m = measure_mesh(boundary_surface(mesh));
        EXPECT_TRUE(m.manifold) << cell;
        EXPECT_EQ(m.components, 1u) << cell;
    }
}

TEST_F(IsosurfaceStuffing, ConvergesAsTheSquareOfTheCell) {
    const double radius = 40;
    const DensityMap map = sphere_map(96, radius, Vec3d(0.21, 0.13, -0.37));
    std::vector<double> volume_error, distance;
    for (const double cell : {8.0, 4.0, 2.0}) {
        const TetMesh mesh = isosurface_stuffing(map, 0, with(cell, 2));
        volume_error.push_back(4 * M_PI * std::pow(radius, 3) / 3 - volume(mesh));
        double worst = 0;  // of the middles of the boundary's faces
        for (const Triangle& f : mesh.faces) {
            const Vec3d middle = (mesh.points[f[0]] + mesh.points[f[1]] + mesh.points[f[2]]) / 3;
            worst = std::max(worst, std::abs(radius - (middle - Vec3d(0.21, 0.13, -0.37)).norm()));
        }
        distance.push_back(worst);
    }
    for (std::size_t k = 1; k < volume_error.size(); ++k) {
        EXPECT_NEAR(std::log2(volume_error[k - 1] / volume_error[k]), 2, 0.4);
        EXPECT_NEAR(std::log2(distance[k - 1] / distance[k]), 2, 0.5);
    }
}

TEST_F(IsosurfaceStuffing, VolumesAreThoseOfMarchingCubesAtTheDefaultCell) {
    for (const char* kind : {"sphere", "torus", "atpase"}) {
        const DensityMap map = phantom_map(kind, 96);
        const double isovalue = std::string(kind) == "atpase" ? 0.5 : 0;
        const TetMesh mesh = isosurface_stuffing(map, isovalue);
        expect_sound(mesh);
        const double expected = marching_cubes_volume(map, isovalue);
        EXPECT_NEAR(volume(mesh) / expected, 1, 0.01) << kind;
    }
}

TEST_F(IsosurfaceStuffing, NoiseIsSound) {
    const DensityMap map = phantom_map("atpase", 48, 0.5);
    for (const double cell : {0.8, 1.5}) expect_sound(isosurface_stuffing(map, 0.5, with(cell, 3)));
    const std::vector<float> values = test::noise(24 * 24 * 24, 17);
    const DensityMap noise = map_from_values(Vec3i::Constant(24), values);
    for (const double cell : {0.5, 1.0, 2.3}) expect_sound(isosurface_stuffing(noise, 0.1, with(cell, 2)));
}

// --- Grading ----------------------------------------------------------------------------------------------

/// The boundary by positions.
std::set<std::array<std::array<std::int64_t, 3>, 3>> boundary_shape(const TetMesh& mesh) {
    std::set<std::array<std::array<std::int64_t, 3>, 3>> out;
    for (const Triangle& f : mesh.faces) {
        std::array<std::array<std::int64_t, 3>, 3> t;
        for (std::size_t k = 0; k < 3; ++k) t[k] = rounded(mesh.points[f[k]]);
        std::sort(t.begin(), t.end());
        out.insert(t);
    }
    return out;
}

TEST_F(IsosurfaceStuffing, GradingChangesNothingAtTheSurface) {
    const DensityMap map = phantom_map("torus", 56);
    const TetMesh uniform = isosurface_stuffing(map, 0, with(0.8, 0));
    const auto boundary = boundary_shape(uniform);
    std::size_t before = uniform.tets.size();
    for (const int coarsening : {1, 2, 3, 4, 8}) {
        const TetMesh mesh = isosurface_stuffing(map, 0, with(0.8, coarsening));
        expect_sound(mesh);
        EXPECT_EQ(boundary_shape(mesh), boundary);
        EXPECT_NEAR(volume(mesh) / volume(uniform), 1, 1e-11);
        EXPECT_EQ(euler(mesh), 0);
        EXPECT_LE(mesh.tets.size(), before);
        before = mesh.tets.size();
    }
    EXPECT_LT(before, 3 * uniform.tets.size() / 4);
}

/// A tetrahedron's six angles, sorted and rounded to degrees.
std::array<long, 6> angle_type(const std::array<double, 6>& angles) {
    std::array<long, 6> out;
    std::transform(angles.begin(), angles.end(), out.begin(), [](double a) { return std::lround(a); });
    std::sort(out.begin(), out.end());
    return out;
}

TEST_F(IsosurfaceStuffing, InsideAreTheFourShapesOfTheBackground) {
    // A ball as large as 256 cells: leaves of every level to 5.
    const DensityMap map = sphere_map(64, 25, Vec3d(0.1, 0.2, -0.3));
    const TetMesh mesh = isosurface_stuffing(map, 0, with(0.4, 8));
    expect_sound(mesh);
    std::vector<bool> outer(mesh.points.size(), false);
    for (const Triangle& f : mesh.faces)
        for (const VertexId v : f) outer[v] = true;
    std::map<std::array<long, 6>, std::set<long>> sizes;  // by type: log2 of the volume over the finest
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const Tetrahedron& v = mesh.tets[t];
        if (outer[v[0]] || outer[v[1]] || outer[v[2]] || outer[v[3]]) continue;
        sizes[angle_type(dihedrals(corners(mesh, t)))].insert(
            std::lround(std::log2(tet_determinant(mesh, t) / (0.4 * 0.4 * 0.4 / 2))));
    }
    const std::array<long, 6> whole{60, 60, 60, 60, 90, 90}, half{45, 60, 60, 90, 90, 90},
        quarter{45, 45, 60, 90, 90, 90}, pyramid{45, 45, 60, 60, 90, 120};
    ASSERT_EQ(sizes.size(), 4u);
    for (const auto& type : {whole, half, quarter, pyramid}) EXPECT_EQ(sizes.count(type), 1u);
    // The whole ones are of 8^level finest.
    EXPECT_EQ(*sizes[whole].begin(), 0);
    EXPECT_GE(*sizes[whole].rbegin(), 12);
    for (const long size : sizes[whole]) EXPECT_EQ(size % 3, 0);
}

// --- Frames, determinism, cancelling ----------------------------------------------------------------------

TEST_F(IsosurfaceStuffing, CellsAreCubesInAnyFrame) {
    Frame skewed;
    skewed.axes << 1.0, 0.3, -0.2, 0.0, 1.4, 0.25, 0.1, 0.0, 2.1;
    Frame turned = centred_frame(56, 1);
    turned.axes = Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    Frame mirrored = turned;
    mirrored.axes.col(0) *= -1;
    for (Frame frame : {skewed, turned, mirrored}) {
        const Vec3i size(56, 40, 36);
        frame.origin = Vec3d(100, -50, 20);
        const Vec3d middle = frame.to_world(0.5 * (size.cast<double>() - Vec3d::Ones()));
        const double radius = 14;
        const DensityMap map =
            map_from_function(size, frame, [&](const Vec3d& p) { return radius - (p - middle).norm(); });
        const TetMesh mesh = isosurface_stuffing(map, 0, with(1.2, 2));
        expect_sound(mesh);
        EXPECT_NEAR(volume(mesh) / (4 * M_PI * std::pow(radius, 3) / 3), 1, 0.02);
        EXPECT_EQ(euler(mesh), 1);
        // A point of the mesh that is far inside lies on the world's lattice.
        const double cell = 1.2 * map.frame.voxel_size().minCoeff();
        std::size_t far_inside = 0;
        for (const Vec3d& p : mesh.points)
            if ((p - middle).norm() < radius - 3 * cell) {
                const Vec3d at = 2 * (p - frame.origin) / cell;
                ASSERT_LT((at - at.array().round().matrix()).norm(), 1e-6);
                ++far_inside;
            }
        EXPECT_GT(far_inside, 50u);
    }
}

TEST_F(IsosurfaceStuffing, SameBytesForAnyNumberOfThreads) {
    const DensityMap map = phantom_map("atpase", 64, 1.0);
    TetMesh one, many;
    test::with_threads(1, [&] { one = isosurface_stuffing(map, 0.5, with(0.9, 3)); });
    for (const std::size_t threads : {2, 5}) {
        test::with_threads(threads, [&] { many = isosurface_stuffing(map, 0.5, with(0.9, 3)); });
        ASSERT_EQ(one.points.size(), many.points.size());
        EXPECT_EQ(std::memcmp(one.points.data(), many.points.data(), one.points.size() * sizeof(Vec3d)), 0);
        EXPECT_EQ(one.tets, many.tets);
        EXPECT_EQ(one.faces, many.faces);
    }
}

TEST_F(IsosurfaceStuffing, Cancels) {
    const DensityMap map = sphere_map(40, 14);
    for (const double when : {0.0, 0.2, 0.6, 0.95}) {
        std::atomic<int> calls{0};
        const Progress progress([&](double fraction) { return ++calls, fraction < when; });
        EXPECT_THROW(isosurface_stuffing(map, 0, {}, progress), Cancelled);
    }
}

// --- Edges of the input -----------------------------------------------------------------------------------

TEST_F(IsosurfaceStuffing, RefusesBadOptionsAndEmptyMaps) {
    const DensityMap map = sphere_map(20, 6);
    for (const double cell :
         {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
        EXPECT_THROW(isosurface_stuffing(map, 0, with(cell, 1)), InvalidInput);
    for (const int coarsening : {-1, 9})
        EXPECT_THROW(isosurface_stuffing(map, 0, with(1, coarsening)), InvalidInput);
    EXPECT_THROW(isosurface_stuffing(map, std::nan(""), {}), InvalidInput);
    EXPECT_THROW(isosurface_stuffing(map, 100, {}), NumericalError);
    EXPECT_THROW(isosurface_stuffing(map, 0, with(1e-7, 1)), NumericalError);
    StuffingOptions few = with(1, 3);
    few.max_tets = 1000;
    EXPECT_THROW(isosurface_stuffing(map, 0, few), NumericalError);
    const DensityMap layer = map_from_values(Vec3i(8, 8, 1), std::vector<float>(64, 1.0f));
    EXPECT_THROW(isosurface_stuffing(layer, 0, {}), NumericalError);
}

TEST_F(IsosurfaceStuffing, FullBoxIsTheBox) {
    const Vec3i size(17, 13, 9);
    const DensityMap map = map_from_values(size, std::vector<float>(17 * 13 * 9, 1.0f));
    for (const double cell : {0.7, 1.0, 2.0, 2.9}) {
        const TetMesh mesh = isosurface_stuffing(map, 0.5, with(cell, 3));
        expect_sound(mesh);
        EXPECT_EQ(euler(mesh), 1);
        for (const Vec3d& p : mesh.points)
            for (int a = 0; a < 3; ++a) {
                ASSERT_GE(p[a], -1e-9);
                ASSERT_LE(p[a], size[a] - 1 + 1e-9);
            }
        // What is lost are the sharp edges.
        EXPECT_NEAR(volume(mesh) / (16 * 12 * 8), 1, 0.02 * cell * cell);
    }
}

TEST_F(IsosurfaceStuffing, SurfaceMeetsTheBorder) {
    const DensityMap map = sphere_map(24, 15);  // the box cuts it on six sides
    const TetMesh mesh = isosurface_stuffing(map, 0, with(1, 2));
    expect_sound(mesh);
    EXPECT_EQ(euler(mesh), 1);
}

TEST_F(IsosurfaceStuffing, ValuesThatEqualTheIsovalue) {
    std::vector<float> values(16 * 16 * 16, 0.0f);
    for (int x = 4; x < 12; ++x)
        for (int y = 4; y < 12; ++y)
            for (int z = 4; z < 12; ++z) values[static_cast<std::size_t>(x + 16 * (y + 16 * z))] = 1;
    const DensityMap map = map_from_values(Vec3i::Constant(16), values);
    for (const double isovalue : {1.0, 0.5, 0.25})
        for (const double cell : {0.5, 1.0}) {
            const TetMesh mesh = isosurface_stuffing(map, isovalue, with(cell, 3));
            expect_sound(mesh);
            EXPECT_EQ(euler(mesh), 1);
            // The cube is 7 + 2 (1 − isovalue) wide.
            const double side = 7 + 2 * (1 - isovalue);
            EXPECT_NEAR(volume(mesh) / (side * side * side), 1, 0.06);
        }
}

TEST_F(IsosurfaceStuffing, OneVoxel) {
    std::vector<float> values(9 * 9 * 9, 0.0f);
    values[4 + 9 * (4 + 9 * 4)] = 1;
    const DensityMap map = map_from_values(Vec3i::Constant(9), values);
    for (const double cell : {0.2, 0.5, 1.0}) expect_sound(isosurface_stuffing(map, 0.5, with(cell, 3)));
    // No lattice point is inside, or it is so near to the surface that it is snapped.
    for (const double cell : {3.0, 4.0})
        EXPECT_THROW(isosurface_stuffing(map, 0.5, with(cell, 3)), NumericalError);
}

TEST_F(IsosurfaceStuffing, SamplesThatAreNoNumbersAreEmpty) {
    const Vec3i size(24, 24, 24);
    const Frame frame = centred_frame(24, 1);
    const DensityMap map = map_from_function(size, frame, [](const Vec3d& p) {
        return p.x() > 4 ? std::numeric_limits<double>::quiet_NaN() : 9 - p.norm();
    });
    const TetMesh mesh = isosurface_stuffing(map, 0, with(0.8, 2));
    expect_sound(mesh);
    for (const Vec3d& p : mesh.points) EXPECT_LE(p.x(), 4.6);
    EXPECT_GT(volume(mesh), 2000);
}

TEST_F(IsosurfaceStuffing, WideConstantRegions) {
    // A fog volume: 1 inside, 0 outside, a ramp of one voxel; and far apart pieces of a sparse unbounded
    // grid.
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->denseFill(openvdb::CoordBBox(openvdb::Coord(-24), openvdb::Coord(31)), 1.0f, true);
    const openvdb::Coord far(100000, -70000, 50000);
    grid->denseFill(openvdb::CoordBBox(far, far.offsetBy(9)), 1.0f, true);
    grid->pruneGrid();
    const DensityMap map = map_from_grid(grid);
    ASSERT_FALSE(map.frame.bounded());
    const TetMesh mesh = isosurface_stuffing(map, 0.5, with(1, 4));
    expect_sound(mesh);
    EXPECT_NEAR(volume(mesh) / (std::pow(56, 3) + 1000), 1, 0.01);
    EXPECT_EQ(euler(mesh), 2);
}

TEST_F(IsosurfaceStuffing, BodyOfALevelSetIsWhatIsBounded) {
    // Distances, negative inside, background above the isovalue.
    auto grid = openvdb::FloatGrid::create(3.0f);
    auto accessor = grid->getAccessor();
    for (auto c = openvdb::CoordBBox(openvdb::Coord(-14), openvdb::Coord(14)).begin(); c; ++c) {
        const double d = (*c).asVec3d().length() - 9.3;
        if (std::abs(d) < 3)
            accessor.setValueOn(*c, static_cast<float>(d));
        else if (d < 0)
            accessor.setValueOff(*c, -3.0f);
    }
    const DensityMap map = map_from_grid(grid);
    const TetMesh mesh = isosurface_stuffing(map, 0, with(0.75, 2));
    expect_sound(mesh);
    EXPECT_EQ(euler(mesh), 1);
    EXPECT_NEAR(volume(mesh) / (4 * M_PI * std::pow(9.3, 3) / 3), 1, 0.02);
}

// --- Real maps --------------------------------------------------------------------------------------------

DensityMap read_map(const std::string& name) {
    MrcReader reader(test::data_folder() / name);
    const Vec3i size = reader.frame().size;
    const auto order = reader.order();
    std::vector<float> values(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
                              static_cast<std::size_t>(size.z()));
    reader.read_sections(values.data(), size[order[2]]);
    GridBuilder builder(size, order, {});
    builder.add_sections(values.data(), size[order[2]]);
    return builder.finish(reader.frame());
}

TEST_F(IsosurfaceStuffing, RealMap) {
    VDBGEO_NEEDS_DATA("mainmastseg/MAP_m4A.mrc.gz");
    const DensityMap map = read_map("mainmastseg/MAP_m4A.mrc.gz");
    const TetMesh mesh = isosurface_stuffing(map, 0.7);
    const auto [least, largest] = angle_range(mesh);
    EXPECT_GE(least, 10.7);
    EXPECT_LE(largest, 164.8);
    EXPECT_NEAR(volume(mesh) / marching_cubes_volume(map, 0.7), 1, 0.01);
    // Where the boundary touches itself: walls and gaps of a cell.
    const MeshMeasures m = measure_mesh(boundary_surface(mesh));
    RecordProperty("non_manifold_edges", static_cast<int>(m.non_manifold_edges));
    RecordProperty("non_manifold_vertices", static_cast<int>(m.non_manifold_vertices));
    EXPECT_LT(m.non_manifold_edges + m.non_manifold_vertices, m.vertices / 500);
}

TEST_F(IsosurfaceStuffing, OtherRealMapsAreSound) {
    for (const auto& [name, isovalue] : std::vector<std::pair<std::string, double>>{
             {"cylindra/beta-tubulin.mrc", 0}, {"sfftk/emd_5625.map", 0}, {"npc2018/emd_5556.map", 0}}) {
        if (!test::have_data(name)) continue;
        const DensityMap map = read_map(name);
        const double level = map.statistics.mean + 2 * map.statistics.rms + isovalue;
        expect_sound(isosurface_stuffing(map, level, with(1, 3)));
    }
}

}  // namespace
}  // namespace vdbgeo
