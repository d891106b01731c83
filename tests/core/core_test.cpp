#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <cmath>
#include <limits>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/core/progress.h"
#include "vdbgeo/core/tri_mesh.h"

using namespace vdbgeo;

TEST(Progress, PartsNest) {
    std::vector<double> seen;
    const Progress all([&](double f) { return seen.push_back(f), true; });
    const Progress second = all.part(0.5, 1.0).part(0.0, 0.5);
    second.report(0);
    second.report(0.5);
    second.report(2);  // clamped
    EXPECT_EQ(seen, (std::vector<double>{0.5, 0.625, 0.75}));
}

TEST(Progress, FalseCancels) {
    const Progress stop([](double) { return false; });
    EXPECT_THROW(stop.report(0.1), Cancelled);
    EXPECT_NO_THROW(Progress().report(0.1));
}

TEST(Parallel, SumsHaveTheSameBitsForAnyThreadCount) {
    const auto sum = [](int threads) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
        return fixed_order_reduce(
            1000003, 1000, 0.0,
            [](std::size_t begin, std::size_t end) {
                double s = 0;
                for (std::size_t i = begin; i < end; ++i) s += std::sin(static_cast<double>(i)) * 1e-3;
                return s;
            },
            [](double& all, double part) { all += part; });
    };
    EXPECT_EQ(sum(1), sum(2));
    EXPECT_EQ(sum(1), sum(7));
}

TEST(Parallel, BlocksCoverTheRangeOnce) {
    std::vector<std::atomic<int>> touched(1001);
    parallel_blocks(touched.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) ++touched[i];
    });
    for (const auto& n : touched) EXPECT_EQ(n, 1);
}

TEST(TriMeshCheck, NamesWhatIsWrong) {
    TriMesh mesh;
    mesh.points = {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
    mesh.triangles = {{0, 1, 2}};
    EXPECT_NO_THROW(check(mesh, "m"));
    mesh.vertex_properties.push_back({"k", 1, {1, 2}});
    EXPECT_THROW(check(mesh, "m"), InvalidInput);
    mesh.vertex_properties.clear();
    mesh.triangles.push_back({0, 1, 3});
    EXPECT_THROW(check(mesh, "m"), InvalidInput);
    mesh.triangles.pop_back();
    mesh.points[1].x() = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(check(mesh, "m"), InvalidInput);
}
