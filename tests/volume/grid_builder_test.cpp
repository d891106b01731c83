// Dense samples → sparse grid, against the plain way of doing it.
#include "vdbgeo/volume/grid_builder.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tests/support/maps.h"
#include "vdbgeo/core/errors.h"

using namespace vdbgeo;
using openvdb::Coord;

namespace {

constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();
constexpr float inf = std::numeric_limits<float>::infinity();

const std::array<int, 3> orders[] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
const Vec3i sizes[] = {{16, 8, 24}, {17, 9, 5}, {1, 1, 1}, {1, 30, 11}, {40, 1, 9}, {8, 8, 8}, {7, 23, 64}};

std::size_t volume(const Vec3i& size) {
    return static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
           static_cast<std::size_t>(size.z());
}

/// Where the sample at (x, y, z) lies in data of that order.
std::size_t place(const Vec3i& size, const std::array<int, 3>& order, const Coord& p) {
    std::size_t at = 0;
    for (int k = 2; k >= 0; --k)
        at = at * static_cast<std::size_t>(size[order[std::size_t(k)]]) +
             static_cast<std::size_t>(p[order[std::size_t(k)]]);
    return at;
}

template <class Visit>
void for_each_sample(const Vec3i& size, const Visit& visit) {
    for (int x = 0; x < size.x(); ++x)
        for (int y = 0; y < size.y(); ++y)
            for (int z = 0; z < size.z(); ++z) visit(Coord(x, y, z));
}

/// Noise with everything that a float can be: NaNs with payloads, both zeros, denormals, infinities, and
/// blocks of one value.
std::vector<float> odd_values(std::size_t count) {
    std::vector<float> values = test::noise(count, 3);
    const std::uint32_t bits[] = {0x7FC00001, 0xFFC12345, 0x7FA00001, 0x80000000, 0,
                                  1,          0x807FFFFF, 0x7F800000, 0xFF800000, 0x7F7FFFFF};
    for (std::size_t i = 0; i < count; i += 7) std::memcpy(&values[i], &bits[i / 7 % 10], 4);
    return values;
}

DensityMap build(const Vec3i& size, const std::vector<float>& values, const SparsifyOptions& options = {},
                 const std::array<int, 3>& order = {0, 1, 2}, int at_a_time = 1 << 30) {
    GridBuilder builder(size, order, options);
    const std::size_t section = volume(size) / static_cast<std::size_t>(size[order[2]]);
    for (int done = 0; done < size[order[2]];) {
        const int count = std::min(at_a_time, size[order[2]] - done);
        builder.add_sections(values.data() + section * static_cast<std::size_t>(done), count);
        done += count;
    }
    return builder.finish(Frame());
}

SparsifyOptions sparse(std::optional<float> threshold, std::optional<float> band = {},
                       std::optional<float> background = {}) {
    SparsifyOptions options;
    options.threshold = threshold;
    options.band = band;
    options.background = background;
    return options;
}

bool same_bits(float a, float b) { return std::memcmp(&a, &b, 4) == 0; }

::testing::AssertionResult same_tree(const DensityMap& a, const DensityMap& b) {
    const auto &s = a.grid->tree(), &t = b.grid->tree();
    if (!s.hasSameTopology(t)) return ::testing::AssertionFailure() << "topologies differ";
    if (!same_bits(s.background(), t.background())) return ::testing::AssertionFailure() << "backgrounds";
    auto p = s.cbeginValueAll(), q = t.cbeginValueAll();
    for (; p && q; ++p, ++q)
        if (!same_bits(*p, *q)) return ::testing::AssertionFailure() << "values at " << p.getCoord();
    const Statistics &u = a.statistics, &v = b.statistics;
    if (u.mean != v.mean || u.rms != v.rms || u.min != v.min || u.max != v.max || u.count != v.count)
        return ::testing::AssertionFailure() << "statistics differ";
    return ::testing::AssertionSuccess();
}

/// The rules of SparsifyOptions, sample by sample.
void expect_rules(const DensityMap& map, const std::vector<float>& values, const SparsifyOptions& o) {
    const auto accessor = map.grid->getConstAccessor();
    const float background = map.grid->background();
    for_each_sample(map.frame.size, [&](const Coord& p) {
        const float v = values[place(map.frame.size, {0, 1, 2}, p)];
        const float low = o.band ? *o.threshold - *o.band : *o.threshold;
        const float high = o.band ? *o.threshold + *o.band : inf;
        const bool above = std::isfinite(v) && v > high, kept = std::isfinite(v) && v > low && !above;
        ASSERT_EQ(accessor.isValueOn(p), kept) << p << " " << v;
        ASSERT_TRUE(same_bits(accessor.getValue(p), kept    ? v
                                                    : above ? high
                                                            : background))
            << p << ": " << v << " reads " << accessor.getValue(p);
    });
    // Outside the box there is only background.
    const Vec3i n = map.frame.size;
    for (const Coord& p : {Coord(-1, 0, 0), Coord(0, -1, 0), Coord(0, 0, -1), Coord(n.x(), 0, 0),
                           Coord(0, n.y(), 0), Coord(0, 0, n.z()), Coord(n.x(), n.y(), n.z())}) {
        EXPECT_FALSE(accessor.isValueOn(p)) << p;
        EXPECT_EQ(accessor.getValue(p), background) << p;
    }
}

}  // namespace

TEST(GridBuilder, KeepingAllGivesBackEveryBit) {
    for (const Vec3i& size : sizes)
        for (const auto& order : orders) {
            const std::vector<float> values = odd_values(volume(size));
            const DensityMap map = build(size, values, {}, order);
            const auto accessor = map.grid->getConstAccessor();
            for_each_sample(size, [&](const Coord& p) {
                ASSERT_TRUE(same_bits(accessor.getValue(p), values[place(size, order, p)])) << p;
                ASSERT_TRUE(accessor.isValueOn(p)) << p;
            });
            EXPECT_EQ(map.grid->activeVoxelCount(), volume(size));
            EXPECT_EQ(map.frame.size, size);
        }
}

TEST(GridBuilder, SlabsOfEightMakeTheTreeOfAllAtOnce) {
    for (const Vec3i& size : sizes)
        for (const auto& order : orders)
            for (const SparsifyOptions& o : {sparse({}), sparse(0.3f), sparse(0.1f, 0.2f)}) {
                const std::vector<float> values = test::noise(volume(size), 5);
                const DensityMap whole = build(size, values, o, order);
                EXPECT_TRUE(same_tree(whole, build(size, values, o, order, 8)));
                EXPECT_TRUE(same_tree(whole, build(size, values, o, order, 16)));
            }
}

TEST(GridBuilder, SameTreeForAnyNumberOfThreads) {
    const Vec3i size(50, 47, 39);
    const std::vector<float> values = test::noise(volume(size), 11);
    const DensityMap once = build(size, values, sparse(0.2f, 0.5f));
    for (const std::size_t threads : {1, 2, 7}) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        EXPECT_TRUE(same_tree(once, build(size, values, sparse(0.2f, 0.5f), {0, 1, 2}, 8))) << threads;
    }
}

TEST(GridBuilder, ThresholdsAndBands) {
    const Vec3i size(30, 17, 24);
    for (const float offset : {0.0f, -5.0f, 1000.0f}) {
        std::vector<float> values = test::noise(volume(size), 17);
        // Whole blocks above, below and inside, so that there are tiles.
        for_each_sample(size, [&](const Coord& p) {
            float& v = values[place(size, {0, 1, 2}, p)];
            if (p.x() / 8 == 1) v = p.y() / 8 == 0 ? 0.9f : -0.9f;
            if (p.x() / 8 == 2 && p.y() / 8 == 1) v = 0.25f;
            v += offset;
        });
        for (const auto& o : {sparse(offset), sparse(offset + 0.25f), sparse(offset - 2), sparse(offset + 2),
                              sparse(offset + 0.25f, 0.25f), sparse(offset, 0.5f), sparse(offset, 10.f),
                              sparse(offset - 0.5f, 0.5f), sparse(offset + 0.1f, {}, offset - 3),
                              sparse(offset + 0.1f, 0.3f, offset)}) {
            const DensityMap map = build(size, values, o);
            expect_rules(map, values, o);
            if (o.background) {
                EXPECT_EQ(map.grid->background(), *o.background);
            }
        }
    }
}

TEST(GridBuilder, ValuesAtTheLimits) {
    // Kept is what lies above the threshold, or in (isovalue − band, isovalue + band].
    const std::vector<float> values = {-1,    -0.5f, std::nextafter(-0.5f, 0.f), 0,
                                       -0.0f, 0.5f,  std::nextafter(0.5f, 1.f),  1};
    const Vec3i size(8, 1, 1);
    const auto active = [&](const SparsifyOptions& o) {
        const DensityMap map = build(size, values, o);
        expect_rules(map, values, o);
        return map.grid->activeVoxelCount();
    };
    EXPECT_EQ(active(sparse(0.0f)), 3u);
    EXPECT_EQ(active(sparse(-0.5f)), 6u);
    EXPECT_EQ(active(sparse(0.0f, 0.5f)), 4u);
    EXPECT_EQ(active(sparse(-0.5f, 0.5f)), 4u);  // upper end 0: both zeros are kept
}

TEST(GridBuilder, ConstantBlocksBecomeActiveTiles) {
    const Vec3i size(24, 16, 16);
    std::vector<float> values(volume(size), 3);
    for_each_sample(size, [&](const Coord& p) {
        if (p.x() >= 16) values[place(size, {0, 1, 2}, p)] = static_cast<float>(p.x());
    });
    for (const auto& o : {sparse({}), sparse(2.f), sparse(3.f, 30.f)}) {
        const DensityMap map = build(size, values, o);
        EXPECT_EQ(map.grid->tree().leafCount(), 4u);  // 16 ≤ x < 24
        EXPECT_EQ(map.grid->tree().activeTileCount(), 8u);
        EXPECT_EQ(map.grid->activeVoxelCount(), volume(size));
    }
    const DensityMap zeros = build(Vec3i(8, 8, 8), std::vector<float>(512, -0.0f));
    EXPECT_TRUE(std::signbit(zeros.grid->tree().getValue(Coord(1, 2, 3))));
    EXPECT_EQ(zeros.grid->tree().leafCount(), 0u);
    std::vector<float> mixed(512, 0);
    mixed[100] = -0.0f;  // equal, but not the same bits
    EXPECT_EQ(build(Vec3i(8, 8, 8), mixed).grid->tree().leafCount(), 1u);
}

TEST(GridBuilder, AboveTheBandAreInactiveTilesOfItsUpperEnd) {
    const Vec3i size(16, 8, 8);
    std::vector<float> values(volume(size), 0);
    for_each_sample(size, [&](const Coord& p) {
        if (p.x() >= 8) values[place(size, {0, 1, 2}, p)] = 7 + 0.01f * static_cast<float>(p.y());
    });
    for (const float isovalue : {1.0f, -2.0f}) {  // the upper end is 3, and 0
        const DensityMap map = build(size, values, sparse(isovalue, 2.f, -9.f));
        const auto& tree = map.grid->tree();
        EXPECT_EQ(tree.getValue(Coord(12, 3, 3)), isovalue + 2);
        EXPECT_FALSE(tree.isValueOn(Coord(12, 3, 3)));
        EXPECT_EQ(tree.getValueDepth(Coord(12, 3, 3)), 2);
        EXPECT_EQ(tree.getValue(Coord(20, 3, 3)), -9);
        EXPECT_EQ(tree.getValue(Coord(200, 300, 3)), -9);
        EXPECT_EQ(tree.getValue(Coord(-2000, 3, 3)), -9);
        EXPECT_EQ(tree.isValueOn(Coord(3, 3, 3)), isovalue == -2.0f || isovalue == 1.0f);
    }
}

TEST(GridBuilder, EverythingDropped) {
    const Vec3i size(20, 20, 20);
    const std::vector<float> values = test::noise(volume(size), 23);
    const DensityMap map = build(size, values, sparse(5.f, {}, -1.f));
    EXPECT_TRUE(map.grid->empty());
    EXPECT_EQ(map.grid->background(), -1);
    EXPECT_EQ(map.statistics.count, volume(size));
    EXPECT_NEAR(map.statistics.mean, 0, 0.05);
}

TEST(GridBuilder, SamplesThatAreNotFiniteAreDroppedWithTheRest) {
    const Vec3i size(17, 16, 9);
    const std::vector<float> values = odd_values(volume(size));
    for (const auto& o : {sparse(0.5f), sparse(-2.f), sparse(0.f, 0.5f), sparse(0.f, 0.5f, -1.f)})
        expect_rules(build(size, values, o), values, o);
    const std::vector<float> all_nan(volume(size), not_a_number), all_inf(volume(size), inf);
    EXPECT_TRUE(build(size, all_nan, sparse(0.f)).grid->empty());
    EXPECT_TRUE(build(size, all_inf, sparse(0.f, 1.f)).grid->empty());
    EXPECT_EQ(build(size, all_nan).grid->activeVoxelCount(), volume(size));
}

TEST(GridBuilder, StatisticsAreThoseOfLongDoubles) {
    const Vec3i size(33, 24, 25);
    for (const float offset : {0.0f, 1e6f, -1e6f})
        for (const bool odd : {false, true}) {
            std::vector<float> values = test::noise(volume(size), 29);
            for (float& v : values) v = 3 * v + offset;
            if (odd)
                for (std::size_t i = 0; i < values.size(); i += 101)
                    values[i] = i % 3 == 0 ? not_a_number : inf;
            long double sum = 0, squares = 0;
            std::uint64_t finite = 0;
            float low = inf, high = -inf;
            for (const float v : values) {
                if (!std::isfinite(v)) continue;
                sum += v, ++finite, low = std::min(low, v), high = std::max(high, v);
            }
            const long double mean = sum / finite;
            for (const float v : values)
                if (std::isfinite(v)) squares += (v - mean) * (v - mean);
            const Statistics s = build(size, values, sparse(offset + 1)).statistics;
            EXPECT_EQ(s.count, volume(size));
            EXPECT_EQ(s.non_finite, volume(size) - finite);
            EXPECT_EQ(s.min, low);
            EXPECT_EQ(s.max, high);
            EXPECT_NEAR(s.mean, double(mean), 1e-12 * (1 + std::abs(double(offset))));
            EXPECT_NEAR(s.rms, double(std::sqrt(squares / finite)), 1e-9);
        }
    const Statistics none = build(Vec3i(9, 9, 9), std::vector<float>(729, not_a_number)).statistics;
    EXPECT_EQ(none.non_finite, 729u);
    EXPECT_EQ(none.rms, 0);
}

TEST(GridBuilder, TheSolventLevelIsTheMedianOverTheFacesOfTheBox) {
    for (const Vec3i& size : sizes)
        for (const auto& order : orders) {
            const std::vector<float> values = test::noise(volume(size), 31);
            std::vector<float> border;
            for_each_sample(size, [&](const Coord& p) {
                for (int a = 0; a < 3; ++a)
                    if (p[a] == 0 || p[a] == size[a] - 1) {
                        border.push_back(values[place(size, order, p)]);
                        break;
                    }
            });
            std::sort(border.begin(), border.end());
            EXPECT_EQ(build(size, values, {}, order).grid->background(), border[border.size() / 2]);
            const float median = border[border.size() / 2];
            EXPECT_EQ(build(size, values, sparse(-0.9f), order).grid->background(), std::min(median, -0.9f));
            EXPECT_EQ(build(size, values, sparse(0.5f, 0.8f), order).grid->background(),
                      std::min(median, 0.5f - 0.8f));
        }
}

TEST(GridBuilder, BothEndsOfARowCountForTheSolventLevelOfALargeBox) {
    // Boxes with so many samples on their faces that only some are taken. One of the two great faces reads 0,
    // everything else 1, a little more than half of the border.
    for (const Vec3i& size : {Vec3i(4, 600, 900), Vec3i(4, 1100, 1000), Vec3i(4, 1500, 1400)})
        for (const int end : {0, 3}) {
            std::vector<float> values(volume(size), 1);
            for (int z = 1; z + 1 < size.z(); ++z)
                for (int y = 1; y + 1 < size.y(); ++y) values[place(size, {0, 1, 2}, Coord(end, y, z))] = 0;
            EXPECT_EQ(build(size, values).grid->background(), 1) << size.transpose() << " " << end;
        }
}

TEST(GridBuilder, BadOptionsAreRefused) {
    EXPECT_THROW(sparse(not_a_number).check(), InvalidInput);
    EXPECT_THROW(sparse(inf).check(), InvalidInput);
    EXPECT_THROW(sparse({}, 1.f).check(), InvalidInput);
    EXPECT_THROW(sparse(1.f, 0.f).check(), InvalidInput);
    EXPECT_THROW(sparse(1.f, -1.f).check(), InvalidInput);
    EXPECT_THROW(sparse(1.f, inf).check(), InvalidInput);
    EXPECT_THROW(sparse(1e6f, 1e-3f).check(), InvalidInput);
    EXPECT_THROW(sparse({}, {}, not_a_number).check(), InvalidInput);
    EXPECT_THROW(sparse(1.f, {}, 2.f).check(), InvalidInput);
    EXPECT_NO_THROW(sparse(1.f, {}, 1.f).check());
    EXPECT_NO_THROW(sparse({}, {}, 1.f).check());
    const SparsifyOptions bad = sparse(not_a_number);
    EXPECT_THROW(GridBuilder(Vec3i(8, 8, 8), {0, 1, 2}, bad), InvalidInput);
    EXPECT_THROW(GridBuilder(Vec3i(8, 0, 8), {0, 1, 2}), InvalidInput);
    EXPECT_THROW(GridBuilder(Vec3i(8, 8, 8), {0, 1, 1}), InvalidInput);
    EXPECT_THROW(GridBuilder(Vec3i(8, 8, 8), {1, 2, 3}), InvalidInput);
}

TEST(GridBuilder, WrongNumbersOfSectionsAreRefused) {
    const std::vector<float> values(8 * 8 * 20, 1);
    GridBuilder builder(Vec3i(8, 8, 20), {0, 1, 2});
    EXPECT_THROW(builder.add_sections(values.data(), 0), InvalidInput);
    EXPECT_THROW(builder.add_sections(values.data(), 21), InvalidInput);
    EXPECT_THROW(builder.finish(Frame()), InvalidInput);
    builder.add_sections(values.data(), 8);
    EXPECT_THROW(builder.add_sections(values.data(), 13), InvalidInput);
    EXPECT_THROW(builder.add_sections(values.data(), 5), InvalidInput);  // neither a slab nor the rest
    EXPECT_THROW(builder.finish(Frame()), InvalidInput);
    GridBuilder whole(Vec3i(8, 8, 20), {0, 1, 2});
    whole.add_sections(values.data(), 20);
    EXPECT_NO_THROW(whole.finish(Frame()));
    EXPECT_THROW(whole.finish(Frame()), InvalidInput);
}
