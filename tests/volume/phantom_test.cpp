#include "vdbgeo/volume/phantom.h"

#include <Eigen/LU>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "vdbgeo/core/errors.h"

using namespace vdbgeo;

namespace {

constexpr double pi = 3.14159265358979323846;

using Field = std::function<double(const Vec3d&)>;

std::size_t cube(int size) { return static_cast<std::size_t>(size) * static_cast<std::size_t>(size * size); }

PhantomOptions options_for(const std::string& kind, int size) {
    PhantomOptions o;
    o.kind = kind;
    o.size = size;
    return o;
}

std::vector<float> all_sections(const Phantom& phantom) {
    std::vector<float> values(cube(phantom.frame().size.x()));
    phantom.sections(0, phantom.frame().size.z(), values.data());
    return values;
}

Vec3d gradient(const Field& f, const Vec3d& p, double h = 1e-4) {
    Vec3d g;
    for (int a = 0; a < 3; ++a) g[a] = (f(p + h * Vec3d::Unit(a)) - f(p - h * Vec3d::Unit(a))) / (2 * h);
    return g;
}

std::vector<Vec3d> random_points(int count, double reach) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> coordinate(-reach, reach);
    std::vector<Vec3d> points;
    for (int i = 0; i < count; ++i)
        points.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    return points;
}

/// Volume and area of a phantom by counting samples inside, and samples within `shell` of the surface.
struct Counted {
    double volume = 0, area = 0;
};

Counted count(const std::string& kind, int size) {
    const Phantom phantom(options_for(kind, size));
    const double shell = 2.5 * phantom.frame().voxel_size().x(), voxel = phantom.frame().voxel_volume();
    Counted counted;
    for (const float v : all_sections(phantom)) {
        counted.volume += v > 0 ? voxel : 0;
        counted.area += std::abs(v) < shell ? voxel / (2 * shell) : 0;
    }
    return counted;
}

void expect_bad(const PhantomOptions& o, const std::string& word) {
    try {
        o.check();
        FAIL() << "accepted: " << word;
    } catch (const InvalidInput& e) {
        EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
    }
}

}  // namespace

TEST(PhantomField, KnownValues) {
    EXPECT_DOUBLE_EQ(sphere_field({3, 4, 12}, 10), -3);
    EXPECT_DOUBLE_EQ(sphere_field({0, 0, 0}, 10), 10);
    EXPECT_DOUBLE_EQ(torus_field({10, 0, 0}, 10, 3), 3);
    EXPECT_DOUBLE_EQ(torus_field({0, 14, 3}, 10, 3), -2);
    EXPECT_DOUBLE_EQ(cylinder_field({0, 1, 2}, 5, 20), 4);     // nearest to the side
    EXPECT_DOUBLE_EQ(cylinder_field({0, 1, 9}, 5, 20), 1);     // nearest to the cap
    EXPECT_DOUBLE_EQ(cylinder_field({0, 1, -13}, 5, 20), -3);  // above the cap
    EXPECT_DOUBLE_EQ(cylinder_field({8, 0, 14}, 5, 20), -5);   // nearest to the rim
    EXPECT_DOUBLE_EQ(saddle_field({4, 2, 0}, 3), 2);
    EXPECT_DOUBLE_EQ(catenoid_field({1, 0, 0}, 3), 2);
    EXPECT_DOUBLE_EQ(gyroid_field({25, 0, 0}, 100), 1);
    EXPECT_NEAR(gyroid_field({110, -37, 5}, 100), gyroid_field({10, 63, -95}, 100), 1e-13);
}

TEST(PhantomField, DistancesHaveUnitGradient) {
    const std::vector<std::pair<const char*, Field>> fields = {
        {"sphere", [](const Vec3d& p) { return sphere_field(p, 100); }},
        {"torus", [](const Vec3d& p) { return torus_field(p, 100, 40); }},
        {"cylinder", [](const Vec3d& p) { return cylinder_field(p, 60, 160); }}};
    for (const auto& [name, field] : fields) {
        for (const Vec3d& p : random_points(2000, 150))
            EXPECT_NEAR(gradient(field, p).norm(), 1, 1e-6) << name << " at " << p.transpose();
    }
}

TEST(PhantomField, CatenoidIsMinimal) {
    const double c = 40;
    const auto normal = [&](const Vec3d& p) -> Vec3d {
        return gradient([&](const Vec3d& q) { return catenoid_field(q, c); }, p, 1e-3).normalized();
    };
    for (double z = -60; z <= 60; z += 15) {
        const Vec3d p(c * std::cosh(z / c) * std::cos(z), c * std::cosh(z / c) * std::sin(z), z);
        EXPECT_NEAR(catenoid_field(p, c), 0, 1e-12);
        double divergence = 0;
        for (int a = 0; a < 3; ++a)
            divergence += (normal(p + 0.1 * Vec3d::Unit(a)) - normal(p - 0.1 * Vec3d::Unit(a)))[a] / 0.2;
        EXPECT_NEAR(divergence, 0, 1e-6 / c * 40) << "z " << z;
    }
}

TEST(Phantom, SamplesAreTheFieldAtTheFramesPositions) {
    const std::vector<std::pair<const char*, Field>> fields = {
        {"sphere", [](const Vec3d& p) { return sphere_field(p, 100); }},
        {"torus", [](const Vec3d& p) { return torus_field(p, 100, 40); }},
        {"cylinder", [](const Vec3d& p) { return cylinder_field(p, 60, 160); }},
        {"saddle", [](const Vec3d& p) { return saddle_field(p, 100); }},
        {"catenoid", [](const Vec3d& p) { return catenoid_field(p, 40); }},
        {"gyroid", [](const Vec3d& p) { return gyroid_field(p, 100); }}};
    for (const auto& [kind, field] : fields) {
        const Phantom phantom(options_for(kind, 24));
        const std::vector<float> values = all_sections(phantom);
        std::size_t i = 0;
        for (int z = 0; z < 24; ++z)
            for (int y = 0; y < 24; ++y)
                for (int x = 0; x < 24; ++x, ++i) {
                    const double exact = field(phantom.frame().to_world(Vec3d(x, y, z)));
                    ASSERT_NEAR(values[i], exact, 1e-6 * (1 + std::abs(exact))) << kind;
                }
        EXPECT_NEAR(phantom.frame().to_world(Vec3d(11.5, 11.5, 11.5)).norm(), 0, 1e-12);
    }
}

TEST(Phantom, CountedVolumeAndAreaTendToTheFormulas) {
    struct Case {
        const char* kind;
        double volume, area;
        double coarse, fine;  // bounds on the relative error: first order where faces lie along the grid
    };
    for (const Case& c : {Case{"sphere", 4e6 * pi / 3, 4e4 * pi, 0.02, 0.002},
                          Case{"torus", 2 * pi * pi * 100 * 1600, 4 * pi * pi * 100 * 40, 0.02, 0.002},
                          Case{"cylinder", pi * 3600 * 160, 2 * pi * 60 * (60 + 160), 0.05, 0.01}}) {
        const Counted coarse = count(c.kind, 32), fine = count(c.kind, 160);
        EXPECT_NEAR(coarse.volume / c.volume, 1, c.coarse) << c.kind;
        EXPECT_NEAR(fine.volume / c.volume, 1, c.fine) << c.kind;
        EXPECT_NEAR(fine.area / c.area, 1, 0.01) << c.kind;
    }
}

TEST(Phantom, GyroidHalvesSpace) {
    // 40 samples a period, and not a sample more, so that each is counted once
    PhantomOptions o = options_for("gyroid", 40);
    o.voxel_size = 2.5;
    double inside = 0;
    for (const float v : all_sections(Phantom(o))) inside += v > 0;
    EXPECT_NEAR(inside / 64000, 0.5, 0.002);
}

TEST(Phantom, ClosedKindsFillFourFifthsOfTheBox) {
    for (const PhantomKind& kind : phantom_kinds()) {
        if (kind.name == "saddle" || kind.name == "catenoid" || kind.name == "gyroid") continue;
        const int size = 64;
        const Phantom phantom(options_for(kind.name, size));
        const std::vector<float> values = all_sections(phantom);
        Vec3i low = Vec3i::Constant(size), high = Vec3i::Constant(-1);
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (!(values[i] > phantom.isovalue())) continue;
            const int n = static_cast<int>(i);
            const Vec3i p(n % size, n / size % size, n / (size * size));
            low = low.cwiseMin(p), high = high.cwiseMax(p);
        }
        EXPECT_NEAR((high - low).maxCoeff() / 63.0, 0.8, 0.05) << kind.name;
        EXPECT_GE(low.minCoeff(), 4) << kind.name;
        EXPECT_LE(high.maxCoeff(), size - 5) << kind.name;
    }
}

TEST(Phantom, AnySlabWithAnyThreadsHasTheSameBits) {
    for (const PhantomKind& kind : phantom_kinds()) {
        const int size = 37;
        PhantomOptions o = options_for(kind.name, size);
        o.snr = 0.5;
        const auto limited = [&](std::size_t threads, int step) {
            tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
            const Phantom phantom(o);
            std::vector<float> values(cube(size));
            for (int z = size - 1; z >= 0; z -= step)
                phantom.sections(
                    std::max(z - step + 1, 0), z + 1,
                    values.data() + static_cast<std::size_t>(std::max(z - step + 1, 0) * size * size));
            return values;
        };
        const std::vector<float> whole = limited(1, size);
        EXPECT_EQ(whole, limited(1, 1)) << kind.name;
        EXPECT_EQ(whole, limited(7, 1)) << kind.name;
        EXPECT_EQ(whole, limited(7, 5)) << kind.name;
        EXPECT_EQ(whole, limited(7, size)) << kind.name;
    }
}

TEST(PhantomNoise, HasTheMomentsOfANormal) {
    for (const std::uint64_t seed : {0u, 1u, 12345u}) {
        const int n = 64;
        double sum[5] = {};
        double neighbours = 0, seeds = 0, pairs = 0;
        for (int z = 0; z < n; ++z)
            for (int y = 0; y < n; ++y)
                for (int x = 0; x < n; ++x) {
                    const double v = voxel_noise(seed, x, y, z);
                    for (int k = 1; k <= 4; ++k) sum[k] += std::pow(v, k);
                    neighbours += v * voxel_noise(seed, x, y + 1, z) + v * voxel_noise(seed, x, y, z + 1);
                    pairs += v * voxel_noise(seed, x + 1, y, z);
                    seeds += v * voxel_noise(seed + 1, x, y, z);
                }
        const double count = n * n * n, root = std::sqrt(count);
        // five standard errors: the k-th moment's is √(E v^2k - (E v^k)²) / √count
        EXPECT_NEAR(sum[1] / count, 0, 5 / root);
        EXPECT_NEAR(sum[2] / count, 1, 5 * std::sqrt(2.0) / root);
        EXPECT_NEAR(sum[3] / count, 0, 5 * std::sqrt(15.0) / root);
        EXPECT_NEAR(sum[4] / count, 3, 5 * std::sqrt(96.0) / root);
        EXPECT_NEAR(neighbours / count, 0, 5 * std::sqrt(2.0) / root);
        EXPECT_NEAR(pairs / count, 0, 5 / root);
        EXPECT_NEAR(seeds / count, 0, 5 / root);
    }
}

TEST(PhantomNoise, IsAddedByVoxelNotByPlace) {
    PhantomOptions o = options_for("sphere", 33);
    o.snr = 2;
    o.seed = 99;
    const Phantom phantom(o);
    std::vector<float> noisy(33 * 33), truth(33 * 33);
    phantom.sections(20, 21, noisy.data());
    phantom.truth_sections(20, 21, truth.data());
    for (int i = 0; i < 33 * 33; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const double noise = phantom.noise_sigma() * voxel_noise(99, i % 33, i / 33, 20);
        EXPECT_NEAR(noisy[k], truth[k] + noise, 1e-4);
    }
}

TEST(PhantomNoise, SnrIsAsAsked) {
    for (const char* kind : {"sphere", "clathrin-cage", "gyroid"}) {
        for (const double snr : {0.05, 1.0, 20.0}) {
            PhantomOptions o = options_for(kind, 64);
            o.snr = snr;
            o.seed = 3;
            const Phantom phantom(o);
            std::vector<float> noisy = all_sections(phantom), truth(noisy.size());
            phantom.truth_sections(0, 64, truth.data());
            const float threshold = 0.05f * *std::max_element(truth.begin(), truth.end());
            double n = 0, sum = 0, squares = 0, noise = 0;
            for (std::size_t i = 0; i < truth.size(); ++i) {
                noise += std::pow(double(noisy[i]) - truth[i], 2);
                if (!(truth[i] > threshold)) continue;
                n += 1, sum += truth[i], squares += double(truth[i]) * truth[i];
            }
            const double signal = squares / n - sum / n * (sum / n);
            EXPECT_NEAR(signal / (noise / static_cast<double>(truth.size())) / snr, 1, 0.01) << kind;
        }
    }
}

TEST(PhantomNoise, SeedsDifferAndNoSnrIsTheTruth) {
    PhantomOptions o = options_for("atpase", 20);
    std::vector<float> clean = all_sections(Phantom(o)), truth(clean.size());
    Phantom(o).truth_sections(0, 20, truth.data());
    EXPECT_EQ(clean, truth);
    EXPECT_EQ(Phantom(o).noise_sigma(), 0);
    o.snr = 1;
    const std::vector<float> first = all_sections(Phantom(o));
    Phantom(o).truth_sections(0, 20, truth.data());
    EXPECT_EQ(clean, truth);
    o.seed = 1;
    const std::vector<float> second = all_sections(Phantom(o));
    int same = 0;
    for (std::size_t i = 0; i < first.size(); ++i) same += first[i] == second[i];
    EXPECT_LT(same, 10);
}

TEST(PhantomOptions, BadOnesAreNamed) {
    expect_bad(options_for("teapot", 64), "teapot");
    expect_bad(options_for("sphere", 1), "size");
    expect_bad(options_for("sphere", 16385), "size");
    for (const double bad : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
        PhantomOptions o;
        o.snr = bad;
        expect_bad(o, "snr");
        o = {};
        o.voxel_size = bad;
        expect_bad(o, "voxel_size");
        o = {};
        o.radius = bad;
        expect_bad(o, "radius");
    }
    PhantomOptions o = options_for("torus", 64);
    o.minor_radius = 100;
    expect_bad(o, "minor_radius");
    o = options_for("sphere", 64);
    o.minor_radius = 10;
    expect_bad(o, "minor_radius has no meaning");
    o = options_for("virus", 64);
    o.radius = 10;
    expect_bad(o, "radius has no meaning");
    o = options_for("gyroid", 64);
    o.height = 10;
    expect_bad(o, "height has no meaning");
    o = options_for("sphere", 64);
    o.period = 10;
    expect_bad(o, "period has no meaning");
    o = options_for("catenoid", 64);
    o.voxel_size = 100;
    expect_bad(o, "neck");
}

TEST(Phantom, RefusesWhatCannotBe) {
    const Phantom phantom(options_for("sphere", 8));
    std::vector<float> out(8 * 8 * 10);
    EXPECT_THROW(phantom.sections(-1, 2, out.data()), InvalidInput);
    EXPECT_THROW(phantom.sections(0, 9, out.data()), InvalidInput);
    EXPECT_THROW(phantom.truth_sections(3, 2, out.data()), InvalidInput);
    PhantomOptions o = options_for("sphere", 2);  // all eight samples lie outside
    o.snr = 1;
    EXPECT_THROW(Phantom{o}, InvalidInput);
    o.size = 16;
    o.snr = 1e-300;
    EXPECT_THROW(Phantom{o}, InvalidInput);
    o.snr = 1;
    EXPECT_THROW(Phantom(o, Progress([](double) { return false; })), Cancelled);
}
