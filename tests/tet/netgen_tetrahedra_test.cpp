// Closed surfaces filled by NetGen.
#include "vdbgeo/tet/netgen_tetrahedra.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <tbb/global_control.h>

#include <cerrno>
#include <functional>

#include "tests/support/small_meshes.h"
#include "tests/support/tet_checks.h"
#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

using test::cube;
using test::flipped;
using test::icosphere;
using test::joined;

class Netgen : public testing::Test {
 protected:
    void SetUp() override {
        if (!have_netgen()) GTEST_SKIP() << "this build has no NetGen";
    }
};

template <class E>
std::string message_of(const TriMesh& mesh, const NetgenOptions& options = {},
                       const Progress& progress = {}) {
    try {
        netgen_tetrahedra(mesh, options, progress);
    } catch (const E& e) {
        return e.what();
    } catch (const std::exception& e) {
        return std::string("another error: ") + e.what();
    }
    return "no error";
}

TriMesh shifted(const TriMesh& mesh, const Vec3d& shift) {
    return test::moved(mesh, Mat3d::Identity(), shift);
}

TEST_F(Netgen, FillsABallWithoutTouchingItsSurface) {
    const TriMesh ball = shifted(icosphere(3, 10), {40, -3, 7});
    const TetMesh mesh = netgen_tetrahedra(ball);
    test::expect_sound(mesh);
    test::expect_kept(mesh, ball);
    EXPECT_NEAR(test::volumes(mesh).at(1) / test::enclosed_volume(ball), 1, 1e-6);
    const auto [least, largest] = test::dihedral_range(mesh);
    EXPECT_GT(least, 15);
    EXPECT_LT(largest, 155);
}

TEST_F(Netgen, CavitiesStayEmptyAndSolidsInThemAreRegions) {
    const TriMesh all = joined(joined(icosphere(3, 30), flipped(icosphere(2, 20))), icosphere(2, 10));
    const TetMesh mesh = netgen_tetrahedra(all);
    test::expect_sound(mesh);
    test::expect_kept(mesh, all);
    const auto volumes = test::volumes(mesh);
    ASSERT_EQ(volumes.size(), 2u);
    EXPECT_NEAR(volumes.at(1) / test::enclosed_volume(joined(icosphere(3, 30), flipped(icosphere(2, 20)))), 1,
                1e-6);
    EXPECT_NEAR(volumes.at(2) / test::enclosed_volume(icosphere(2, 10)), 1, 1e-6);
}

/// A kernel in a shell: the faces between are those of both.
TEST_F(Netgen, LabelsShareTheirBorders) {
    TriMesh all = joined(joined(icosphere(2, 30), flipped(icosphere(2, 15))), icosphere(2, 15));
    MeshProperty label{"label", 1, std::vector<float>(640, 4.f)};
    label.values.resize(960, 2.f);
    all.face_properties.push_back(label);
    const TetMesh mesh = netgen_tetrahedra(all);
    test::expect_sound(mesh);
    EXPECT_EQ(mesh.faces.size(), 640u);
    std::map<std::array<std::int32_t, 2>, int> pairs;
    for (const auto& pair : mesh.face_regions) ++pairs[pair];
    EXPECT_EQ((pairs[{2, 4}]), 320);
    EXPECT_EQ((pairs[{4, 0}]), 320);
    const auto volumes = test::volumes(mesh);
    EXPECT_NEAR(volumes.at(2) / test::enclosed_volume(icosphere(2, 15)), 1, 1e-6);
}

TEST_F(Netgen, BoundsTheEdges) {
    const TriMesh ball = icosphere(2, 10);
    NetgenOptions fine;
    fine.max_edge_A = 2;
    const TetMesh mesh = netgen_tetrahedra(ball, fine);
    test::expect_kept(mesh, ball);
    EXPECT_LT(test::mean_edge(mesh), 3.5);  // the surface has edges of 3 Å
    EXPECT_GT(mesh.tets.size(), 2 * netgen_tetrahedra(ball).tets.size());
}

TEST_F(Netgen, TheSameBytesForAnyNumberOfThreads) {
    TriMesh balls;
    for (int i = 0; i < 5; ++i) balls = joined(balls, shifted(icosphere(2, 10 - i), {25.0 * i, 0, 0}));
    std::vector<TetMesh> meshes;
    for (const std::size_t threads : {1u, 2u, 4u}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        meshes.push_back(netgen_tetrahedra(balls));
    }
    for (const TetMesh& mesh : meshes) EXPECT_TRUE(test::same_bytes(mesh, meshes[0]));
    EXPECT_EQ(test::volumes(meshes[0]).size(), 5u);
    test::expect_kept(meshes[0], balls);
}

TEST_F(Netgen, StopsAtItsLimits) {
    NetgenOptions options;
    options.max_edge_A = 0.3;
    options.max_seconds = 0.5;
    EXPECT_EQ(message_of<NumericalError>(icosphere(3, 10), options),
              "netgen: stopped after 0.5 s, its limit");
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
    options = {};
    options.max_tets = 100;
    EXPECT_EQ(message_of<NumericalError>(icosphere(2, 10), options),
              "netgen: more than 100 tetrahedra, the limit");
}

/// The first solid that fails is told, and no process is left.
TEST_F(Netgen, TellsWhichSolidFailed) {
    TriMesh balls;
    for (int i = 0; i < 4; ++i) balls = joined(balls, shifted(icosphere(3, 10 - i), {25.0 * i, 0, 0}));
    NetgenOptions options;
    options.max_edge_A = 0.3;
    options.max_seconds = 0.5;
    EXPECT_EQ(message_of<NumericalError>(balls, options), "netgen: region 1: stopped after 0.5 s, its limit");
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
    EXPECT_EQ(errno, ECHILD);
}

TEST_F(Netgen, IsCancelled) {
    NetgenOptions options;
    options.max_edge_A = 0.3;
    int asked = 0;
    EXPECT_EQ(
        message_of<Cancelled>(icosphere(3, 10), options, Progress([&](double) { return ++asked < 10; })),
        "interrupted");
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
}

TEST_F(Netgen, RefusesBadInput) {
    const auto refuses = [](const std::function<void(NetgenOptions&)>& change) {
        NetgenOptions options;
        change(options);
        return message_of<InvalidInput>(cube(), options).rfind("netgen: ", 0) == 0;
    };
    EXPECT_TRUE(refuses([](auto& o) { o.max_edge_A = 0; }));
    EXPECT_TRUE(refuses([](auto& o) { o.grading = 1.1; }));
    EXPECT_TRUE(refuses([](auto& o) { o.optimisation_rounds = 21; }));
    EXPECT_TRUE(refuses([](auto& o) { o.max_tets = 0; }));
    EXPECT_TRUE(refuses([](auto& o) { o.max_seconds = 0; }));
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "inside out",
                        message_of<InvalidInput>(flipped(icosphere(1, 10))));
    EXPECT_PRED_FORMAT2(testing::IsSubstring, "not empty", message_of<InvalidInput>({}));
}

/// Shells so close that hardly a float is between them: filled, or refused; no abort, no hang.
TEST_F(Netgen, NearlyTouchingShellsAreFilledOrRefused) {
    for (const float gap : {1e-2f, 1e-5f}) {
        NetgenOptions options;
        options.max_seconds = 2;
        const TriMesh mesh = joined(icosphere(1, 10), flipped(icosphere(1, 10 - double(gap))));
        try {
            const TetMesh tets = netgen_tetrahedra(mesh, options);
            test::expect_kept(tets, mesh);
            EXPECT_NEAR(test::volumes(tets).at(1) / test::enclosed_volume(mesh), 1, 1e-6);
        } catch (const Error& e) {
            EXPECT_EQ(std::string(e.what()).rfind("netgen", 0), 0u) << e.what();
        }
    }
}

}  // namespace
}  // namespace vdbgeo
