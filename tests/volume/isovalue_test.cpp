#include "vdbgeo/volume/isovalue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "tests/support/grids.h"
#include "vdbgeo/core/errors.h"
#include "vdbgeo/volume/enclosing_level.h"
#include "vdbgeo/volume/map_statistics.h"

using namespace vdbgeo;
using openvdb::Coord;
using openvdb::CoordBBox;
using Rule = Isovalue::Rule;

namespace {

constexpr float dropped = 0.25f;

/// A map of nx × ny × nz samples; those for which keep is false are dropped and read as `dropped`.
DensityMap make_map(
    const Vec3i& size, const std::function<float(const Coord&)>& value,
    const std::function<bool(const Coord&)>& keep = [](const Coord&) { return true; }) {
    DensityMap map;
    map.grid = openvdb::FloatGrid::create(dropped);
    map.frame.size = size;
    map.frame.axes = Vec3d(2, 2.5, 2).asDiagonal();  // 10 Å³ a voxel
    auto to = map.grid->getAccessor();
    for (auto c = CoordBBox({0, 0, 0}, {size.x() - 1, size.y() - 1, size.z() - 1}).begin(); c; ++c)
        if (keep(*c)) to.setValueOn(*c, value(*c));
    map.statistics = statistics_of(map);
    return map;
}

/// All samples, the highest first.
std::vector<float> sorted_samples(const DensityMap& map) {
    std::vector<float> all;
    const auto at = map.grid->getConstAccessor();
    const Vec3i& n = map.frame.size;
    for (auto c = CoordBBox({0, 0, 0}, {n.x() - 1, n.y() - 1, n.z() - 1}).begin(); c; ++c)
        if (const float v = at.getValue(*c); std::isfinite(v)) all.push_back(v);
    std::sort(all.begin(), all.end(), std::greater<>());
    return all;
}

std::uint64_t at_or_above(const std::vector<float>& samples, double level) {
    return static_cast<std::uint64_t>(std::count_if(samples.begin(), samples.end(),
                                                    [&](float v) { return v >= static_cast<float>(level); }));
}

std::function<float(const Coord&)> noise(std::uint32_t seed) {
    return [random = std::mt19937(seed)](const Coord&) mutable {
        return static_cast<float>(random()) * 0x1p-32f * 3 - 1;
    };
}

std::string refusal(const Isovalue& iso, const DensityMap& map) {
    try {
        iso.resolve(map);
    } catch (const InvalidInput& error) {
        return error.what();
    }
    return "(not refused)";
}

}  // namespace

TEST(Isovalue, ParsesNumbersSigmasAndAuto) {
    const auto expect = [](const std::string& text, Rule rule, double number) {
        const Isovalue iso = Isovalue::parse(text);
        EXPECT_EQ(iso.rule, rule) << text;
        EXPECT_EQ(iso.number, number) << text;
    };
    expect("auto", Rule::automatic, 0);
    expect("0.7", Rule::value, 0.7);
    expect("-1e-3", Rule::value, -1e-3);
    expect("0", Rule::value, 0);
    expect(".5", Rule::value, 0.5);
    expect("3sigma", Rule::sigma, 3);
    expect("-2.5sigma", Rule::sigma, -2.5);
    expect("1e1sigma", Rule::sigma, 10);
    expect("otsu", Rule::otsu, 0);
    expect("volume:2.5e5", Rule::volume, 2.5e5);
    expect("volume:0", Rule::volume, 0);
    expect("mass:800", Rule::mass, 800);
    expect("mass:800Da", Rule::mass, 800);
    expect("mass:0.8kDa", Rule::mass, 800);
    expect("mass:2MDa", Rule::mass, 2e6);
}

TEST(Isovalue, RefusesAnythingElse) {
    for (const char* text : {"",
                             " ",
                             "auto ",
                             "Auto",
                             "sigma",
                             "3 sigma",
                             "3sigmas",
                             "3s",
                             "0.7x",
                             "0,7",
                             "nan",
                             "inf",
                             "-inf",
                             "1e999",
                             "infsigma",
                             "nansigma",
                             "0x10",
                             "--1",
                             "3sigma3",
                             "volume",
                             "volume:",
                             "volume:x",
                             "volume:3A",
                             "volume:3sigma",
                             "volume: 3",
                             "volume:inf",
                             "mass:",
                             "mass:3kda",
                             "mass:1e308MDa",
                             "mass:volume:3",
                             "volume:mass:3",
                             "Otsu",
                             "otsu:3"})
        EXPECT_THROW(Isovalue::parse(text), InvalidInput) << "'" << text << "'";
}

TEST(Isovalue, TextIsParsedBackToTheSame) {
    for (const double number : {0.0, 0.1, -1e-300, 1e20, 1.0 / 3, 123456789.0, 5e-324, 1.7e308})
        for (const Rule rule : {Rule::value, Rule::sigma, Rule::volume, Rule::mass}) {
            const Isovalue iso{rule, number};
            const Isovalue back = Isovalue::parse(iso.text());
            EXPECT_EQ(back.rule, rule) << iso.text();
            EXPECT_EQ(back.number, number) << iso.text();
        }
    EXPECT_EQ(Isovalue().text(), "auto");
    EXPECT_EQ((Isovalue{Rule::sigma, 3}.text()), "3sigma");
    EXPECT_EQ(Isovalue::parse("auto").rule, Rule::automatic);
    EXPECT_EQ(Isovalue::parse("otsu").text(), "otsu");
    EXPECT_EQ(Isovalue::parse("mass:0.5kDa").text(), "mass:500");
}

TEST(Isovalue, ResolvesByItsRule) {
    Statistics s;
    s.count = 10;
    s.mean = 2;
    s.rms = 0.5;
    s.max = 5;
    EXPECT_EQ(Isovalue::parse("auto").resolve(s), 3.5);
    EXPECT_EQ(Isovalue::parse("auto").resolve(s, openvdb::GRID_LEVEL_SET), 0);
    EXPECT_EQ(Isovalue::parse("auto").resolve(s, openvdb::GRID_FOG_VOLUME), 2.5);
    EXPECT_EQ(Isovalue::parse("3sigma").resolve(s, openvdb::GRID_LEVEL_SET), 3.5);
    EXPECT_EQ(Isovalue::parse("-1sigma").resolve(s), 1.5);
    EXPECT_EQ(Isovalue::parse("0.7").resolve(s), 0.7);
}

TEST(Isovalue, WithoutAFiniteSampleOnlyANumberResolves) {
    Statistics s;
    EXPECT_THROW(Isovalue::parse("auto").resolve(s), InvalidInput);
    s.count = s.non_finite = 8;
    EXPECT_THROW(Isovalue::parse("3sigma").resolve(s), InvalidInput);
    EXPECT_EQ(Isovalue::parse("0.7").resolve(s), 0.7);
    EXPECT_EQ(Isovalue::parse("auto").resolve(s, openvdb::GRID_LEVEL_SET), 0);
}

TEST(Isovalue, RulesThatNeedSamplesAreNotToldFromStatistics) {
    Statistics s;
    s.count = 10;
    for (const char* text : {"volume:10", "mass:10", "otsu"}) {
        EXPECT_TRUE(Isovalue::parse(text).needs_samples());
        EXPECT_THROW(Isovalue::parse(text).resolve(s), InvalidInput) << text;
    }
    for (const char* text : {"auto", "3sigma", "0.5"}) {
        EXPECT_FALSE(Isovalue::parse(text).needs_samples());
        const DensityMap map = make_map(Vec3i(5, 4, 3), noise(1));
        EXPECT_EQ(Isovalue::parse(text).resolve(map), Isovalue::parse(text).resolve(map.statistics)) << text;
    }
}

TEST(Isovalue, VolumeEnclosesExactlyItsVoxels) {
    const DensityMap map = make_map(Vec3i(21, 17, 13), noise(5));
    const std::vector<float> all = sorted_samples(map);
    for (const std::size_t n : {1, 2, 17, 500, 2320, 4000, 4639, 4640}) {
        const double level = Isovalue{Rule::volume, 10.0 * static_cast<double>(n)}.resolve(map);
        EXPECT_EQ(at_or_above(all, level), n);
        EXPECT_EQ(level, static_cast<float>(level));
        EXPECT_NEAR(level, 0.5 * (double(all[n - 1]) + double(all[n])), 1e-7) << n;
        const double mass = 10.0 * static_cast<double>(n) / Isovalue::A3_per_dalton;
        EXPECT_EQ((Isovalue{Rule::mass, mass}.resolve(map)), level);
    }
    EXPECT_EQ(at_or_above(all, Isovalue::parse("volume:104").resolve(map)), 10u);
    EXPECT_EQ(at_or_above(all, Isovalue::parse("volume:106").resolve(map)), 11u);
}

TEST(Isovalue, VolumePartsNeighbouringFloatsOfEitherSign) {
    for (const float base : {1.0f, -1.0f, 0.0f, 3e38f, -3e38f}) {
        std::vector<float> values{base};
        while (values.size() < 8)
            values.push_back(std::nextafter(values.back(), std::numeric_limits<float>::max()));
        const DensityMap map =
            make_map(Vec3i(8, 1, 1), [&](const Coord& c) { return values[static_cast<std::size_t>(c.x())]; });
        for (std::size_t n = 1; n < 8; ++n)
            EXPECT_EQ(at_or_above(values, Isovalue{Rule::volume, 10.0 * static_cast<double>(n)}.resolve(map)),
                      n);
    }
    // −0 and 0 are one value.
    const DensityMap zeros = make_map(Vec3i(4, 1, 1), [](const Coord& c) {
        return c.x() == 0 ? 0.0f : c.x() == 1 ? -0.0f : static_cast<float>(-c.x());
    });
    EXPECT_EQ(Isovalue::parse("volume:20").resolve(zeros), -1);
}

TEST(Isovalue, VolumeOfASparseMapCountsWhatWasDropped) {
    const auto value = noise(9);
    const DensityMap map =
        make_map(Vec3i(40, 40, 40), value, [](const Coord& c) { return c.x() < 11 && c.z() > 3; });
    const std::vector<float> all = sorted_samples(map);
    ASSERT_EQ(all.size(), 64000u);
    const std::uint64_t above = at_or_above(all, std::nextafter(dropped, 1.0f));
    for (const std::uint64_t n : {std::uint64_t(1), std::uint64_t(777), above, std::uint64_t(63990)})
        EXPECT_EQ(at_or_above(all, Isovalue{Rule::volume, 10.0 * static_cast<double>(n)}.resolve(map)), n);
    EXPECT_NE(refusal(Isovalue{Rule::volume, 10.0 * 20000}, map)
                  .find("volume:200000: no level encloses 200000 Å^3"),
              std::string::npos);
    DensityMap tiled = map;
    tiled.grid = map.grid->deepCopy();
    tiled.grid->sparseFill(CoordBBox({24, 0, 0}, {39, 39, 39}), 7.0f, true);  // tiles, not leaves
    EXPECT_EQ(at_or_above(sorted_samples(tiled), Isovalue{Rule::volume, 10.0 * 25601}.resolve(tiled)),
              25601u);
}

TEST(Isovalue, VolumeOfEqualSamplesIsTheNearest) {
    // 100 samples of each of 0…9
    const DensityMap map =
        make_map(Vec3i(10, 10, 10), [](const Coord& c) { return static_cast<float>(c.x()); });
    EXPECT_EQ(Isovalue::parse("volume:3090").resolve(map), 6.5);  // 300, not 309
    EXPECT_EQ(Isovalue::parse("volume:5500").resolve(map), 3.5);  // both as near: the larger
    EXPECT_EQ(refusal(Isovalue::parse("volume:1500"), map),
              "volume:1500: no level encloses 1500 Å^3, for many samples are equal or were dropped; next to "
              "it 1000 "
              "and 2000 Å^3");
    EXPECT_EQ(refusal(Isovalue::parse("volume:300"), map),
              "volume:300: no level encloses 300 Å^3, for many samples are equal or were dropped; next to it "
              "1000 Å^3");
}

TEST(Isovalue, VolumesThatNothingEnclosesAreRefusedWithTheRange) {
    const DensityMap map = make_map(Vec3i(10, 10, 10), noise(3));
    for (const char* text : {"0", "-5", "4", "10000", "1e9", "1e300"})
        EXPECT_EQ(
            refusal(Isovalue::parse(std::string("volume:") + text), map)
                .substr(refusal(Isovalue::parse(std::string("volume:") + text), map).find("expected")),
            "expected a volume between 10 Å^3, one voxel, and 9990 Å^3, all voxels above the lowest value")
            << text;
    EXPECT_NE(refusal(Isovalue::parse("mass:1MDa"), map).find("mass:1000000: that are 1.23e+06 Å^3"),
              std::string::npos);
    const DensityMap flat = make_map(Vec3i(3, 3, 3), [](const Coord&) { return 1.0f; });
    EXPECT_EQ(refusal(Isovalue::parse("volume:10"), flat),
              "volume:10: no level of the map encloses a volume: its samples are all equal");
    EXPECT_EQ(refusal(Isovalue::parse("otsu"), flat),
              "otsu: the map's samples are all equal: there are no two classes");
    DensityMap level_set = make_map(Vec3i(5, 5, 5), noise(3));
    level_set.grid->setGridClass(openvdb::GRID_LEVEL_SET);
    for (const char* text : {"volume:100", "mass:100", "otsu"})
        EXPECT_NE(refusal(Isovalue::parse(text), level_set).find("a level set holds distances"),
                  std::string::npos);
    const DensityMap nan =
        make_map(Vec3i(3, 3, 3), [](const Coord&) { return std::numeric_limits<float>::quiet_NaN(); });
    for (const char* text : {"volume:100", "otsu"})
        EXPECT_NE(refusal(Isovalue::parse(text), nan), "(not refused)");
}

TEST(Isovalue, WithoutABoxTheBackgroundGoesOnForEver) {
    DensityMap map = make_map(Vec3i(30, 20, 10), noise(4));
    map.frame.size = Vec3i::Zero();
    std::vector<float> above;
    for (auto it = map.grid->cbeginValueOn(); it; ++it)
        if (*it > dropped) above.push_back(*it);
    for (const std::size_t n : {std::size_t(1), std::size_t(1000), above.size() - 1})
        EXPECT_EQ(at_or_above(above, Isovalue{Rule::volume, 10.0 * static_cast<double>(n)}.resolve(map)), n);
    EXPECT_NE(refusal(Isovalue{Rule::volume, 10.0 * static_cast<double>(above.size())}, map),
              "(not refused)");
}

TEST(Isovalue, NonFiniteSamplesAreLeftOut) {
    const auto value = noise(8);
    const DensityMap map = make_map(Vec3i(16, 16, 16), [&](const Coord& c) {
        const float v = value(c);
        if (c.x() == 3) return std::numeric_limits<float>::quiet_NaN();
        if (c.y() == 3) return (c.z() & 1 ? 1 : -1) * std::numeric_limits<float>::infinity();
        return v;
    });
    EXPECT_EQ(at_or_above(sorted_samples(map), Isovalue::parse("volume:5000").resolve(map)), 500u);
    EXPECT_TRUE(std::isfinite(Isovalue::parse("otsu").resolve(map)));
}

TEST(Isovalue, OtsuMakesTheVarianceBetweenTheClassesLargest) {
    std::mt19937 random(12);
    std::normal_distribution<float> solvent(0, 1), protein(6, 1.5f);
    const DensityMap map = make_map(Vec3i(32, 32, 32), [&](const Coord& c) {
        return (c.asVec3d() - openvdb::Vec3d(15.5)).length() < 9 ? protein(random) : solvent(random);
    });
    const std::vector<float> all = sorted_samples(map);
    // Brute force over all partings of the sorted samples.
    double sum = 0, best = -1, level = 0, upper = 0;
    for (const float v : all) sum += v;
    const double n = static_cast<double>(all.size());
    for (std::size_t k = 1; k < all.size(); ++k) {
        upper += all[k - 1];
        const double w = static_cast<double>(k) / n,
                     apart = upper / static_cast<double>(k) - (sum - upper) / (n * (1 - w));
        if (w * (1 - w) * apart * apart > best) {
            best = w * (1 - w) * apart * apart;
            level = 0.5 * (double(all[k - 1]) + double(all[k]));
        }
    }
    const double bin = (double(all.front()) - double(all.back())) / 65536;
    EXPECT_NEAR(Isovalue::parse("otsu").resolve(map), level, 2 * bin);
    EXPECT_GT(level, 2);
    EXPECT_LT(level, 5);
}

TEST(Isovalue, OtsuOfTwoValuesIsHalfWayAndDroppedSamplesAreOfTheBackground) {
    const auto dense =
        make_map(Vec3i(20, 20, 20), [](const Coord& c) { return c.x() < 3 ? 1.25f : dropped; });
    const auto sparse = make_map(
        Vec3i(20, 20, 20), [](const Coord&) { return 1.25f; }, [](const Coord& c) { return c.x() < 3; });
    EXPECT_NEAR(Isovalue::parse("otsu").resolve(dense), 0.75, 1e-4);
    EXPECT_EQ(Isovalue::parse("otsu").resolve(sparse), Isovalue::parse("otsu").resolve(dense));
}

TEST(Isovalue, LevelsAreTheSameForAnyNumberOfThreads) {
    const DensityMap map = make_map(Vec3i(70, 60, 50), noise(6),
                                    [](const Coord& c) { return (c.x() / 9 + c.y() / 7) % 3 != 0; });
    for (const char* text : {"volume:1e5", "mass:100kDa", "otsu"}) {
        double one = 0, four = 1;
        test::with_threads(1, [&] { one = Isovalue::parse(text).resolve(map); });
        test::with_threads(4, [&] { four = Isovalue::parse(text).resolve(map); });
        EXPECT_EQ(one, four) << text;
    }
}

TEST(Isovalue, ManyLevelsAtOnceAreThoseOfEach) {
    const DensityMap map = make_map(Vec3i(40, 30, 20), noise(2));
    const std::vector<float> all = sorted_samples(map);
    std::vector<std::uint64_t> wanted;
    for (std::uint64_t n = 1; n < 20000; n = n * 3 / 2 + 1) wanted.push_back(n);
    const EnclosingLevels levels(map, wanted);
    EXPECT_EQ(levels.samples(), 24000u);
    EXPECT_EQ(levels.most(), 24000u - 1);
    std::vector<double> found;
    for (std::size_t k = 0; k < wanted.size(); ++k) {
        const auto& level = levels.choices()[k].nearest();
        ASSERT_TRUE(level);
        EXPECT_EQ(level->voxels, wanted[k]);
        EXPECT_EQ(at_or_above(all, level->level), wanted[k]);
        found.push_back(level->level);
    }
    EXPECT_EQ(voxels_above(map, found), wanted);
}

TEST(Isovalue, SelectionCanBeCancelled) {
    const DensityMap map = make_map(Vec3i(10, 10, 10), noise(2));
    for (const char* text : {"volume:1e3", "otsu"})
        EXPECT_THROW(Isovalue::parse(text).resolve(map, Progress([](double) { return false; })), Cancelled);
}
