// Closed surfaces filled by TetGen.
#include "vdbgeo/tet/tetgen_tetrahedra.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cerrno>
#include <functional>

#include "converters/map_file.h"
#include "tests/support/data.h"
#include "tests/support/maps.h"
#include "tests/support/small_meshes.h"
#include "tests/support/tet_checks.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/mesh_subset.h"
#include "vdbgeo/measure/mesh_components.h"
#include "vdbgeo/surface/delaunay_surface.h"
#include "vdbgeo/surface/label_surfaces.h"
#include "vdbgeo/volume/phantom.h"

namespace vdbgeo {
namespace {

using test::cube;
using test::flipped;
using test::icosphere;
using test::joined;

class Tetgen : public testing::Test {
 protected:
    void SetUp() override {
        if (!have_tetgen()) GTEST_SKIP() << "this build has no TetGen";
    }
};

template <class E>
std::string message_of(const TriMesh& mesh, const TetgenOptions& options = {},
                       const Progress& progress = {}) {
    try {
        tetgen_tetrahedra(mesh, options, progress);
    } catch (const E& e) {
        return e.what();
    } catch (const std::exception& e) {
        return std::string("another error: ") + e.what();
    }
    return "no error";
}

TriMesh turned(const TriMesh& mesh, const Vec3d& shift = Vec3d::Zero()) {
    return test::moved(mesh, Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix(), shift);
}

void expect_volume(const TetMesh& mesh, const TriMesh& surface) {
    double volume = 0;
    for (const auto& [region, v] : test::volumes(mesh)) volume += v;
    const double expected = test::enclosed_volume(surface);
    EXPECT_NEAR(volume, expected, 1e-6 * expected);
}

TEST_F(Tetgen, FillsABallWithoutTouchingItsSurface) {
    const TriMesh ball = turned(icosphere(3, 10), {100, -50, 3});
    const TetMesh mesh = tetgen_tetrahedra(ball);
    test::expect_sound(mesh);
    test::expect_kept(mesh, ball);
    expect_volume(mesh, ball);
    EXPECT_GT(mesh.points.size(), ball.points.size());
    const auto [least, largest] = test::dihedral_range(mesh);
    EXPECT_GT(least, 9.9);
    EXPECT_LT(largest, 165.1);
    EXPECT_LT(test::largest_radius_edge(mesh), 1.5);
}

/// Flat sides whose triangles TetGen would join, and swap the edges of.
TEST_F(Tetgen, KeepsTrianglesThatLieInAPlane) {
    TriMesh block = test::cells_mesh(4, [](int x, int y, int z) { return x + y + z != 0; });
    remove_unused_vertices(block);
    for (const TriMesh& mesh : {block, cube(), test::torus_mesh(30, 10, 24, 12)}) {
        const TetMesh tets = tetgen_tetrahedra(mesh);
        test::expect_sound(tets);
        test::expect_kept(tets, mesh);
        expect_volume(tets, mesh);
    }
}

TEST_F(Tetgen, CavitiesStayEmptyAndSolidsInThemAreRegions) {
    const TriMesh all = joined(joined(turned(icosphere(3, 30)), flipped(icosphere(3, 20))), icosphere(2, 10));
    const TetMesh mesh = tetgen_tetrahedra(all);
    test::expect_sound(mesh);
    test::expect_kept(mesh, all);
    expect_volume(mesh, all);
    const auto volumes = test::volumes(mesh);
    ASSERT_EQ(volumes.size(), 2u);
    EXPECT_NEAR(volumes.at(2), test::enclosed_volume(icosphere(2, 10)), 1e-3);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        Vec3d centre = Vec3d::Zero();
        for (const VertexId v : mesh.tets[t]) centre += mesh.points[v] / 4;
        EXPECT_TRUE(mesh.regions[t] == 2 ? centre.norm() < 10 : centre.norm() > 19) << centre.norm();
    }
}

/// Neighbouring labels share the vertices and the faces between them.
TEST_F(Tetgen, LabelsShareTheirBorders) {
    const DensityMap map =
        test::map_from_function(Vec3i::Constant(32), test::centred_frame(32, 2), [](const Vec3d& p) {
            if (p.norm() < 12) return 2.0;
            if (p.norm() < 24) return p.x() > 0.5 ? 5.0 : 9.0;
            return 0.0;
        });
    TriMesh all;
    MeshProperty label{"label", 1, {}};
    std::map<std::int32_t, double> expected;
    for (const LabelSurface& s : label_surfaces(map)) {
        all = joined(all, s.mesh);
        label.values.resize(all.triangles.size(), float(s.label));
        expected[std::int32_t(s.label)] = test::enclosed_volume(s.mesh);
    }
    all.face_properties.push_back(label);
    const TetMesh mesh = tetgen_tetrahedra(all);
    test::expect_sound(mesh);
    const auto volumes = test::volumes(mesh);
    ASSERT_EQ(volumes.size(), 3u);
    std::map<std::array<std::int32_t, 2>, int> pairs;
    for (const auto& pair : mesh.face_regions) ++pairs[pair];
    for (const auto& [region, volume] : expected) EXPECT_NEAR(volumes.at(region) / volume, 1, 1e-6) << region;
    for (const std::array<std::int32_t, 2>& pair :
         {std::array{2, 5}, std::array{2, 9}, std::array{5, 9}, std::array{5, 0}, std::array{9, 0}})
        EXPECT_GT(pairs[pair], 50) << pair[0] << ' ' << pair[1];
    EXPECT_EQ(pairs.size(), 5u);
}

TEST_F(Tetgen, TouchingSolidsAreJoined) {
    for (const Vec3f& corner : {Vec3f(1, 0, 0), Vec3f(1, 1, 0), Vec3f(1, 1, 1)}) {
        const TetMesh mesh = tetgen_tetrahedra(joined(cube(), cube(corner)));
        EXPECT_NEAR(test::volumes(mesh).at(1), 1, 1e-12);
        EXPECT_NEAR(test::volumes(mesh).at(2), 1, 1e-12);
        EXPECT_EQ(mesh.points.size(), corner.y() == 0 ? 12u : corner.z() == 0 ? 14u : 15u);
    }
}

TEST_F(Tetgen, TheSameBytesEachTime) {
    const TriMesh ball = joined(icosphere(3, 10), turned(icosphere(2, 5), {30, 0, 0}));
    EXPECT_TRUE(test::same_bytes(tetgen_tetrahedra(ball), tetgen_tetrahedra(ball)));
}

/// Strictly where the surface may change; where it is kept, tetrahedra on its triangles may be larger.
TEST_F(Tetgen, BoundsTheVolume) {
    const TriMesh ball = icosphere(2, 10);
    TetgenOptions options;
    for (const bool keep : {true, false}) {
        options.keep_surface = keep;
        options.max_volume_A3 = 3;
        const TetMesh mesh = tetgen_tetrahedra(ball, options);
        double largest = 0;
        for (std::size_t t = 0; t < mesh.tets.size(); ++t)
            largest = std::max(largest, tet_determinant(mesh, t) / 6);
        EXPECT_LE(largest, keep ? 6 : 3);
        expect_volume(mesh, ball);
        if (keep) test::expect_kept(mesh, ball);
        options.max_volume_A3.reset();
        EXPECT_GT(mesh.tets.size(), tetgen_tetrahedra(ball, options).tets.size() * 3 / 2);
    }
}

TEST_F(Tetgen, FollowsASizeField) {
    const TriMesh ball = icosphere(2, 10);
    TetgenOptions options;
    options.keep_surface = false;
    options.size = [](const Vec3d& p) { return p.x() < 0 ? 1.0 : 2.0; };
    const TetMesh mesh = tetgen_tetrahedra(ball, options);
    test::expect_sound(mesh);
    expect_volume(mesh, ball);
    double sums[2] = {};
    std::size_t counts[2] = {};
    for (const Tetrahedron& t : mesh.tets)
        for (const auto& [i, j] : tet_edges) {
            const Vec3d a = mesh.points[t[std::size_t(i)]], b = mesh.points[t[std::size_t(j)]];
            if (std::abs(a.x() + b.x()) < 6 || (a + b).norm() > 16) continue;
            const int half = a.x() > 0;
            sums[half] += (a - b).norm();
            ++counts[half];
        }
    ASSERT_GT(counts[0], 100u);
    ASSERT_GT(counts[1], 100u);
    EXPECT_NEAR(sums[0] / double(counts[0]), 1, 0.2);
    EXPECT_NEAR(sums[1] / double(counts[1]), 2, 0.4);
}

TEST_F(Tetgen, RefusesASizeFieldThatIsNone) {
    TetgenOptions options;
    options.size = [](const Vec3d& p) { return p.x() < 3 ? 5.0 : 0.0; };
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "tetgen: the size of edges wanted at",
                        message_of<InvalidInput>(icosphere(2, 10), options));
}

TEST_F(Tetgen, StopsAtItsLimits) {
    TetgenOptions options;
    options.max_volume_A3 = 1e-4;
    options.max_tets = 20'000;
    EXPECT_EQ(message_of<NumericalError>(icosphere(2, 10), options),
              "tetgen: more than 20000 tetrahedra, the limit");
    options.max_tets = 100;
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "more than the 100 tetrahedra allowed",
                        message_of<InvalidInput>(icosphere(2, 10), options));
    options.max_tets = 50'000'000;
    options.max_seconds = 0.5;
    EXPECT_EQ(message_of<NumericalError>(icosphere(2, 10), options),
              "tetgen: stopped after 0.5 s, its limit");
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    options.max_seconds = 3600;
    options.max_bytes = 50'000'000;
    EXPECT_EQ(message_of<NumericalError>(icosphere(2, 10), options),
              "tetgen: out of memory: it may take 50 MB");
#endif
}

TEST_F(Tetgen, IsCancelled) {
    TetgenOptions options;
    options.max_volume_A3 = 1e-4;
    int asked = 0;
    EXPECT_EQ(
        message_of<Cancelled>(icosphere(2, 10), options, Progress([&](double) { return ++asked < 10; })),
        "interrupted");
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
    EXPECT_EQ(errno, ECHILD);
}

TEST_F(Tetgen, RefusesBadOptions) {
    const auto refuses = [](const std::function<void(TetgenOptions&)>& change) {
        TetgenOptions options;
        change(options);
        return message_of<InvalidInput>(cube(), options).rfind("tetgen: ", 0) == 0;
    };
    EXPECT_TRUE(refuses([](auto& o) { o.radius_edge = 0.9; }));
    EXPECT_TRUE(refuses([](auto& o) { o.radius_edge = std::nan(""); }));
    EXPECT_TRUE(refuses([](auto& o) { o.min_dihedral_deg = 19; }));
    EXPECT_TRUE(refuses([](auto& o) { o.max_volume_A3 = 0; }));
    EXPECT_TRUE(refuses([](auto& o) { o.max_tets = 0; }));
    EXPECT_TRUE(refuses([](auto& o) { o.max_seconds = -1; }));
}

TEST_F(Tetgen, RefusesBadSurfaces) {
    TriMesh open = icosphere(1, 10);
    open.triangles.pop_back();
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "tetgen needs a mesh that is closed",
                        message_of<InvalidInput>(open));
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "inside out",
                        message_of<InvalidInput>(flipped(icosphere(1, 10))));
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "not empty", message_of<InvalidInput>({}));
    // Cut by 0.1: told by us, or by TetGen where this build has no CGAL.
    EXPECT_PRED_FORMAT2(testing::IsSubstring, " cut ",
                        message_of<InvalidInput>(joined(cube(), cube({0.9f, 0.1f, 0.2f}))));
}

/// Shells so close that hardly a float is between them: filled to the last bit, or refused; no abort, no
/// hang.
TEST_F(Tetgen, NearlyTouchingShellsAreFilledOrRefused) {
    int filled = 0;
    for (const float gap : {1e-1f, 1e-3f, 1e-5f, 1e-6f, 2e-7f}) {
        TetgenOptions options;
        options.max_tets = 2'000'000;
        options.max_seconds = 20;
        const TriMesh both = joined(cube(), cube({1 + gap, 0.25f, 0.125f}));
        const TriMesh nested = joined(icosphere(2, 10), flipped(icosphere(2, 10 - double(gap))));
        for (const TriMesh& mesh : {both, nested}) try {
                const TetMesh tets = tetgen_tetrahedra(mesh, options);
                expect_volume(tets, mesh);
                test::expect_kept(tets, mesh);
                ++filled;
            } catch (const Error& e) {
                EXPECT_EQ(std::string(e.what()).rfind("tetgen", 0), 0u) << e.what();
            }
    }
    EXPECT_GE(filled, 4);
}

/// A complex with stalks and rings, its surface by restricted Delaunay refinement.
TEST_F(Tetgen, FillsASpecimen) {
    if (!have_delaunay()) GTEST_SKIP() << "this build has no CGAL";
    PhantomOptions phantom_options;
    phantom_options.kind = "atpase";
    phantom_options.size = 48;
    const Phantom phantom(phantom_options);
    std::vector<float> values(48 * 48 * 48);
    phantom.sections(0, 48, values.data());
    const DensityMap map = test::map_from_values(Vec3i::Constant(48), values, phantom.frame());
    DelaunaySurfaceOptions surface_options;
    surface_options.isovalue = phantom.isovalue();
    const TriMesh surface = delaunay_surface(map, surface_options);
    const TetMesh mesh = tetgen_tetrahedra(surface);
    test::expect_sound(mesh);
    test::expect_kept(mesh, surface);
    expect_volume(mesh, surface);
    const auto [least, largest] = test::dihedral_range(mesh);
    EXPECT_GT(least, 2);
    EXPECT_LT(largest, 176);
}

TEST_F(Tetgen, FillsThePiecesOfARealMap) {
    VDBGEO_NEEDS_DATA("mainmastseg/MAP_m4A.mrc.gz");
    if (!have_delaunay()) GTEST_SKIP() << "this build has no CGAL";
    MapReadOptions reading;
    reading.crop = Crop{{80, 80, 80}, {100, 100, 100}};
    const MapFile file = read_map(test::data_folder() / "mainmastseg/MAP_m4A.mrc.gz", reading);
    DelaunaySurfaceOptions options;
    options.isovalue = 0.7;
    ComponentFilter filter;
    filter.min_volume_A3 = 0.1;
    const TriMesh surface = filter_components(delaunay_surface(file.map, options), filter);
    const TetMesh mesh = tetgen_tetrahedra(surface);
    test::expect_sound(mesh);
    test::expect_kept(mesh, surface);
    expect_volume(mesh, surface);
    EXPECT_GT(mesh.tets.size(), 5000u);
}

}  // namespace
}  // namespace vdbgeo
